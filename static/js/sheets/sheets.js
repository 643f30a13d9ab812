/** The two dialogs made from the registry of commands: help with its keys, and the palette. */
import { all, fill, h, one, parts } from "../elements/dom.js";
import { symbolOf } from "../elements/drawn.js";
import { COMMANDS, keyLabel, perform, search } from "../state/commands.js";
import { PLACES } from "../state/address.js";

/* ---------- What the palette finds besides commands: places, recordings, tracks, parameters and
   bookmarks, by their words. Nothing here touches the page but its address. */

/** Offers of each kind at most: who sees as many types another word. */
const MOST = 12;

/**
 * @param {Readonly<PageState>} state
 * @param {Actions} actions
 * @param {(parameter: Server.ParameterInfo) => void} edit  asks for a parameter's value
 * @returns {Offer[]}
 */
export function offersOf(state, actions, edit) {
	const { sequences, timeline, schema, server, link, layouts, bookmarks } = state;
	const own = [
		...PLACES.filter(({ exists }) => !exists || exists(state)).map(({ name, word, tip }) => ({
			title: `${word}: ${tip[0].toLowerCase()}${tip.slice(1)}`,
			keys: [],
			run: () => (location.hash = `#${name}`),
		})),
		...Object.keys(layouts).map((name) => ({
			title: `Layout ${name}, your own`,
			keys: [],
			run: () => actions.arrange(name),
		})),
	];
	if (link !== "open") return own;
	const shown = new Set(server?.shown ?? []);
	return [
		...own,
		...(schema?.parameters ?? [])
			.filter(({ key }) => shown.has(key))
			// Of two of one name the one that the panel shows first is meant.
			.toSorted((a, b) => Number(b.essential) - Number(a.essential))
			.map((parameter) => ({
				title: `${parameter.label} ${parameter.symbol} · ${parameter.group.replace("_", " ")} = ${server?.parameters[parameter.key]}`,
				symbol: parameter.symbol,
				keys: [],
				run: () => edit(parameter),
			})),
		...sequences
			.filter(({ error }) => !error)
			.map(({ name }) => ({ title: `Open ${name}`, keys: [], run: () => void actions.open(name) })),
		...(timeline?.tracks ?? []).map(({ id, first, name }) => ({
			title: `Track ${id}${name ? `, ${name}` : ""}`,
			keys: [],
			run: () => actions.go(`${first} ${id}`),
		})),
		...bookmarks.map(({ step, note }) => ({
			title: `Bookmark ${step}${note ? `, ${note}` : ""}`,
			keys: [],
			run: () => actions.stepBy(step - state.step),
		})),
	];
}

/**
 * Those with all words of a text, some of each; without a text none.
 * @param {Offer[]} offers @param {string} text
 */
export function matching(offers, text) {
	const words = text.toLowerCase().split(/\s+/).filter(Boolean);
	if (!words.length) return [];
	/** @type {Record<string, number>} */
	const counts = {};
	return offers.filter(({ title }) => {
		const said = title.toLowerCase();
		if (!words.every((word) => said.includes(word))) return false;
		const kind = /^(Open|Track) /.exec(title)?.[1] ?? "";
		return (counts[kind] = (counts[kind] ?? 0) + 1) <= MOST;
	});
}

/**
 * The value that somebody typed for a parameter; null where it cannot be one.
 * @param {Server.ParameterInfo} parameter @param {string} text
 */
export function valueOf({ kind, minimum, maximum, choices }, text) {
	const typed = text.trim();
	if (kind === "choice") return choices.find((choice) => choice.startsWith(typed)) ?? null;
	if (kind === "bool")
		return /^(on|true|yes|1)$/i.test(typed)
			? true
			: /^(off|false|no|0)$/i.test(typed)
				? false
				: null;
	const number = typed === "" ? NaN : Number(typed.replace(",", "."));
	const fits = number >= (minimum ?? -Infinity) && number <= (maximum ?? Infinity);
	return fits && (kind !== "int" || Number.isInteger(number)) ? number : null;
}

/** What a parameter may be. @param {Server.ParameterInfo} parameter */
const rangeOf = ({ kind, minimum, maximum, unit, choices }) =>
	kind === "choice"
		? choices.join(", ")
		: kind === "bool"
			? "on or off"
			: `${minimum} … ${maximum} ${unit}`.trim();

/** So many commands that were used last come first in the palette. */
const RECENT = 8;

/** What a row of the palette says. @param {Offer} offer */
function worded({ title, symbol }) {
	if (!symbol) return [title];
	const at = title.indexOf(symbol);
	return [title.slice(0, at), symbolOf(symbol), title.slice(at + symbol.length)];
}

/** @param {string[]} keys */
const signs = (keys) => keys.map((key) => h("kbd", keyLabel(key)));

/** @param {Context} context */
export function mountSheets({ store, actions }) {
	const [help, palette] = /** @type {any[]} */ (all("dialog"));
	const { sheet, single } = parts(help);
	const { input, list } = parts(palette);
	for (const dialog of [help, palette]) {
		dialog.addEventListener(
			"click",
			(/** @type {Event} */ event) => event.target === dialog && dialog.close(),
		);
	}

	const row = (/** @type {Command} */ { name, title, keys }) => {
		const cameras = name === "camera-1";
		return h(
			"div.key-row",
			cameras ? "Camera 1 to 9 large, again: all alike" : title,
			h("span.grow"),
			cameras ? [...signs(["1"]), "–", ...signs(["9"])] : signs(keys),
		);
	};
	const listed = COMMANDS.filter(({ name, keys }) => keys.length && !/^camera-[2-9]$/.test(name));
	fill(
		sheet,
		[...new Set(listed.map(({ group }) => group))].map((group) =>
			h(
				"section",
				h("h3", group, group === "Check" && h("span.small", " · in that place, before all others")),
				listed.filter((c) => c.group === group).map(row),
			),
		),
	);
	single.addEventListener("change", () => store.set({ singleKeys: single.checked }));
	actions.help = () => {
		if (help.open) return help.close();
		single.checked = store.get().singleKeys;
		help.showModal();
	};

	let at = 0;
	/** @type {Offer[]} */
	let found = [];
	/** Whose value is asked for.  @type {Server.ParameterInfo | null} */
	let asked = null;
	/** Whether a name for the layout is asked for. */
	let naming = false;

	/** @returns {Offer[]} */
	function offered() {
		if (naming) return layoutOffers();
		if (asked) return valueOffers(asked);
		const { used } = store.get();
		const matched = search(input.value);
		// Who has not typed yet most likely wants again what was wanted last.
		const recent = input.value
			? []
			: used.flatMap((name) => matched.filter((one) => one.name === name));
		const commands = [...recent, ...matched.filter((one) => !recent.includes(one))].map(
			(command) => ({
				title: command.title,
				keys: command.keys.slice(0, 1),
				run() {
					const others = used.filter((name) => name !== command.name);
					store.set({ used: [command.name, ...others].slice(0, RECENT) });
					perform(command, actions);
					enter(command);
				},
			}),
		);
		return [...commands, ...matching(offersOf(store.get(), actions, edit), input.value)];
	}
	/** Who asked for a table by its name goes on in it. @param {Command} command */
	function enter({ action, value }) {
		if (action !== "showTab") return;
		const panel = one(`#panel-${value}`);
		panel.tabIndex = -1;
		// Once the panel is there.
		requestAnimationFrame(() => panel.focus());
	}
	/** Keep the layout under what is typed, or forget one. @returns {Offer[]} */
	function layoutOffers() {
		const { layout, layouts } = store.get();
		const name = input.value.trim();
		const { [name]: _, ...others } = layouts;
		const forget = Object.keys(layouts).map((own) => ({
			title: `Forget layout ${own}`,
			keys: [],
			run: () =>
				store.set({
					layouts: Object.fromEntries(Object.entries(layouts).filter(([one]) => one !== own)),
				}),
		}));
		if (!name) return forget;
		const title = name in layouts ? `Replace layout ${name}` : `Keep as layout ${name}`;
		return [{ title, keys: [], run: () => store.set({ layouts: { ...others, [name]: layout } }) }];
	}
	/** @param {Server.ParameterInfo} parameter */
	function edit(parameter) {
		asked = parameter;
		input.value = "";
		palette.showModal();
		offer();
	}
	/** @param {Server.ParameterInfo} parameter @returns {Offer[]} */
	function valueOffers(parameter) {
		const { key, label, unit, choices, kind } = parameter;
		const set = (/** @type {any} */ value) => ({
			title: `${label} = ${value} ${unit}`,
			keys: [],
			run: () => void actions.change({ [key]: value }),
		});
		const typed = input.value ? valueOf(parameter, input.value) : null;
		if (typed !== null) return [set(typed)];
		const words = kind === "choice" ? choices : kind === "bool" ? [true, false] : [];
		const listed = {
			title: `Show ${label} among the parameters`,
			keys: [],
			run() {
				store.set({ sought: key });
				actions.showTab("parameters");
			},
		};
		return input.value ? [] : [...words.map(set), listed];
	}
	function offer() {
		found = offered();
		at = Math.max(0, Math.min(at, found.length - 1));
		input.placeholder = asked
			? `${asked.label}: ${rangeOf(asked)}, now ${store.get().server?.parameters[asked.key]}`
			: naming
				? "Name of this layout"
				: "Command, parameter, recording or track";
		const option = (/** @type {Offer} */ one, /** @type {number} */ index) =>
			h(
				"div.key-row",
				{
					role: "option",
					id: `option-${index}`,
					"aria-selected": String(index === at),
					onclick: () => run(one),
					onpointermove: () => index !== at && choose(index),
				},
				h("span.grow", ...worded(one)),
				signs(one.keys),
			);
		const none = naming
			? "Type a name, then Enter. The palette finds the layout by it."
			: asked
				? `${asked.help} ${rangeOf(asked)}`
				: "Nothing here has these words.";
		fill(list, found.length ? found.map(option) : h("p", none));
		choose(at);
	}
	/** @param {number} index */
	function choose(index) {
		at = index;
		all("[role=option]", list).forEach((option, k) => (option.ariaSelected = String(k === at)));
		input.setAttribute("aria-activedescendant", found.length ? `option-${at}` : "");
		list.children[at]?.scrollIntoView({ block: "nearest" });
	}
	/** @param {Offer} one */
	function run(one) {
		asked = null;
		naming = false;
		palette.close();
		one.run();
	}
	actions.keepLayout = () => {
		actions.palette();
		naming = true;
		offer();
	};
	store.on(["timeline", "sequences"], () => palette.open && offer());
	input.addEventListener("input", () => {
		at = 0;
		offer();
	});
	input.addEventListener("keydown", (event) => {
		const turn = { ArrowDown: 1, ArrowUp: -1 }[event.key];
		if (turn && found.length) choose((at + turn + found.length) % found.length);
		else if (event.key === "Enter" && found[at]) run(found[at]);
		else return;
		event.preventDefault();
	});
	actions.palette = () => {
		if (palette.open) return palette.close();
		asked = null;
		naming = false;
		input.value = "";
		at = 0;
		palette.showModal();
		offer();
	};
	// Asked for before there was anything to offer, and perhaps answered.
	if (palette.open) offer();
	if (palette.open && "hasty" in palette.dataset && found.length) run(found[0]);
}
