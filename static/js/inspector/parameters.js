/**
 * The tab Parameters: one table of all of them, by topics, each with slider, number, unit, what it
 * would change, reset and help; below it presets and the same run without a browser.
 */
import { claim, all, choices, h, icon, parts, show, svg, write } from "../elements/dom.js";
import { fixed, signButton, symbolParts } from "../elements/drawn.js";
import { fetcher, getJson } from "../state/api.js";
import { keyOf } from "../state/commands.js";

/** @typedef {Server.ParameterInfo} Parameter */

/* ---------- Where a number stands on its slider. Nothing here touches the page. */

/** Decades between two places of a logarithmic slider: 2.3 %. */
const LOG_STEP = 0.01;
/** Significant digits of a value that comes from a logarithmic slider. */
const DIGITS = 3;

/**
 * Least place, largest place and step of a parameter's slider: where it has one beside the 3D view
 * it ends where that does, and further out where its value is.
 * @param {Parameter} of @param {number} value @returns {[number, number, number]}
 */
export function placesOf({ minimum, maximum, step, log, kind, slider }, value) {
	const [least, most] = slider ?? [minimum ?? 0, maximum ?? 1];
	const [low, high] = [Math.min(least, value), Math.max(most, value)];
	if (log) return [Math.log10(low), Math.log10(high), LOG_STEP];
	if (kind === "int") return [low, high, Math.max(1, Math.trunc(step ?? 1))];
	return [low, high, step ?? 10 ** Math.floor(Math.log10((high - low) / 50))];
}

/** @param {Parameter} of @param {number} value */
export const placeOf = ({ log }, value) => (log ? Math.log10(value) : value);

/** The value at a place: inside the range, rounded to what the slider can tell apart. @param {Parameter} of @param {number} place */
export function valueAt({ minimum, maximum, log, kind }, place) {
	const number = log ? Number((10 ** place).toPrecision(DIGITS)) : Number(place.toFixed(9));
	const inside = Math.min(Math.max(number, minimum ?? -Infinity), maximum ?? Infinity);
	return kind === "int" ? Math.round(inside) : inside;
}

/** Whether a parameter's name, symbol, key, unit or help has all words of a text. @param {Parameter} of @param {string} text */
export function matches({ label, symbol, key, unit, help }, text) {
	const searched = `${label} ${symbol} ${key} ${unit} ${help}`.toLowerCase();
	return text
		.toLowerCase()
		.split(/\s+/)
		.every((word) => searched.includes(word));
}

/** @param {any} value */
const written = (value) =>
	typeof value === "number"
		? show(value)
		: typeof value === "boolean"
			? value
				? "on"
				: "off"
			: String(value).replaceAll("_", " ");

/**
 * A parameter's effect in words: `0.15 … 0.9: MOTA 0.91 … 0.98, 42 % of the variance`. The scores
 * are the least and the greatest, in this order unless the curve ends lower than it begins.
 * @param {Server.CurveInfo} curve
 */
export function effectOf({ measure, values, scores, whole, share }) {
	const known = scores.filter((score) => score !== null);
	if (!known.length) return "no run with other values";
	const digits = measure === "MOTA" ? 2 : 0;
	const bounds = [Math.min(...known), Math.max(...known)];
	if (known[known.length - 1] < known[0]) bounds.reverse();
	const [low, high] = bounds.map((end) => fixed(end, digits));
	const ends = `${written(values[0])} … ${written(values[values.length - 1])}`;
	const span = low === high ? `${low} throughout` : `${low} … ${high}`;
	const part = share === null ? "" : `, ${Math.round(100 * share)} % of the variance`;
	return `${ends}: ${measure} ${span}${part}${whole ? "" : ", computing"}`;
}

/* ---------- The table. */

/** Topics in the order of a filter's step; methods stand last. */
const METHODS = "Methods";
/** Width and height of a curve, CSS pixels. */
const [WIDE, HIGH] = [44, 14];
/** Curves that are asked for at once. */
const MOST_CURVES = 12;

const METHOD_LABELS = {
	single_view: "Single view",
	fusion_method: "Fusion",
	smoothing_method: "Smoothing",
};

/** A row, and what in it is written again. */
/** @typedef {{of: Parameter, row: HTMLTableRowElement, more: HTMLTableRowElement, name: Part, slider?: Part, field: Part, effect: Part, said: Part, reset: Part}} Row */

/** The methods, as parameters that are choices. @param {Server.Schema} schema @returns {Parameter[]} */
const methodsOf = ({ methods }) =>
	Object.entries(METHOD_LABELS).map(
		([key, label]) =>
			/** @type {Parameter} */ ({
				key,
				label,
				group: "method",
				name: key,
				help: `Method of stage ${Object.keys(METHOD_LABELS).indexOf(key) + 1}.`,
				symbol: "",
				unit: "",
				topic: METHODS,
				kind: "choice",
				choices: methods[key],
				essential: false,
				advanced: false,
				default: key === "single_view" ? undefined : null,
			}),
	);

/** A curve as a drawing, with a dot where the value is now. @param {Server.CurveInfo} curve @param {any} now */
function drawingOf({ measure, values, scores }, now) {
	const known = scores.flatMap((score, k) => (score === null ? [] : [[k, score]]));
	if (!known.length) return null;
	const low = Math.min(...known.map(([, score]) => score));
	const high = Math.max(...known.map(([, score]) => score));
	// A curve that hardly moves is not made to look as if it did.
	const span = Math.max(high - low, measure === "MOTA" ? 0.05 : 1);
	const places = known.map(([k, score]) => [
		3 + (k * (WIDE - 6)) / Math.max(1, values.length - 1),
		HIGH - 3 - ((score - low) * (HIGH - 6)) / span,
	]);
	const at = known.findIndex(([k]) => values[k] === now);
	return svg(
		"svg.curve",
		{ width: WIDE, height: HIGH, "aria-hidden": "true" },
		svg("polyline", { points: places.map((place) => place.join()).join(" ") }),
		at >= 0 && svg("circle", { cx: places[at][0], cy: places[at][1], r: 2.2 }),
	);
}

/** @param {HTMLElement} root  the panel @param {Context} context */
export function mountParameters(root, { store, actions }) {
	const {
		presets,
		presetName,
		savePreset,
		renamePreset,
		removePreset,
		resetAll,
		code,
		find,
		changedOnly,
		effects,
		rows: table,
		none,
	} = parts(root);
	/** @type {Map<string, Row>} */
	const rows = new Map();
	/** @type {Map<string, {body: Part, words: Part, fold: Part}>} */
	const topics = new Map();
	/** @type {Map<string, Server.CurveInfo>} */
	let curves = new Map();

	/* Values go to the server one message after the other, the newest of each parameter. */
	/** @type {Record<string, any>} */
	let wished = {};
	/** @type {Record<string, any>} */
	let sent = {};
	/** The slider that the pointer holds. @type {EventTarget | null} */
	let held = null;

	/** @param {string} key @param {any} value */
	async function wish(key, value) {
		wished[key] = value;
		if (Object.keys(sent).length) return;
		while (Object.keys(wished).length) {
			[sent, wished] = [wished, {}];
			await actions.change(sent);
			sent = {};
		}
		values();
	}
	root.addEventListener("pointerdown", ({ target }) => (held = target));
	addEventListener("pointerup", () => {
		held = null;
		if (rows.size) values();
	});

	/** @param {Parameter} of @returns {Row} */
	function make(of) {
		const { key, label, symbol, unit, kind, group } = of;
		const id = `value-${key}`;
		// Several methods have a parameter of this name.
		const whose = `${label}, ${group.replaceAll("_", " ")}`;
		const published = store.get().schema?.presets.published?.[key];
		const called = { "aria-label": whose, "aria-describedby": `help-${key}` };
		/** @type {Part | undefined} */
		let slider;
		/** @type {any} */
		let field;
		if (kind === "choice")
			field = h("select", { id, ...called, onchange: () => void wish(key, field.value) });
		else if (kind === "bool")
			field = h("input", {
				id,
				type: "checkbox",
				...called,
				onchange: () => void wish(key, field.checked),
			});
		else {
			const bar = (slider = /** @type {any} */ (
				h("input", {
					type: "range",
					// Its own places are on no grid: a value from elsewhere stands where it is.
					step: "any",
					...called,
					oninput: () => slide(bar, of),
					onkeydown: (/** @type {KeyboardEvent} */ event) => {
						const by = { ArrowLeft: -1, ArrowDown: -1, ArrowRight: 1, ArrowUp: 1 }[event.key];
						if (!by) return;
						claim(event);
						bar.value = String(Number(bar.value) + by * placesOf(of, now(key))[2]);
						slide(bar, of);
					},
				})
			));
			field = /** @type {any} */ (
				h("input", {
					id,
					class: "num",
					inputmode: "decimal",
					...called,
					onchange: () => enter(of),
					onkeydown: (/** @type {KeyboardEvent} */ event) => {
						const turn = /** @type {any} */ ({ "Ctrl+z": -1, "Ctrl+Shift+z": 1 })[keyOf(event)];
						// What was entered is a value, and no text that the browser takes back.
						if (turn && field.value === field.defaultValue) {
							claim(event);
							actions.undo(turn);
						}
						if (event.key !== "Escape") return;
						event.stopPropagation();
						field.value = written(now(key));
						field.blur();
					},
				})
			);
		}
		const name = h(
			"button.name",
			{ "aria-expanded": "false", title: of.help, onclick: () => unfold(key) },
			h("i", ...symbolParts(symbol)),
			h("span", label),
			h("span.q", group.replaceAll("_", " ")),
		);
		const reset = signButton("i-reset", `Reset ${whose}`, () => actions.reset(key));
		const effect = h("td.effect");
		const said = h("p");
		const row = h(
			"tr",
			{ "data-key": key },
			h("td", name),
			slider
				? [h("td.slider", slider), h("td.field", field), h("td.unit", unit)]
				: h("td.pick", { colspan: 3 }, field),
			effect,
			h("td", reset),
		);
		const range =
			slider &&
			`${written(of.minimum)} … ${written(of.maximum)}${unit && ` ${unit}`}, ${of.log ? "logarithmic, " : ""}`;
		const more = h(
			"tr.more",
			{ hidden: true },
			h(
				"td",
				{ colspan: 6 },
				h("p", { id: `help-${key}` }, of.help),
				h(
					"p.q",
					range,
					of.default !== undefined && of.default !== null && `default ${written(of.default)}`,
					published !== undefined && `, as published ${written(published)}`,
					` · ${key} · `,
					h("a", { href: `/manual/tuning/#${key}`, target: "manual" }, "In the manual"),
				),
				said,
			),
		);
		return /** @type {any} */ ({ of, row, more, name, slider, field, effect, said, reset });
	}

	/** @param {Part} bar @param {Parameter} of */
	function slide(bar, of) {
		const [min, max] = [Number(bar.min), Number(bar.max)];
		const step = placesOf(of, now(of.key))[2];
		// The ends are on no grid of steps.
		const place = Number(bar.value);
		const onGrid = Math.min(max, min + Math.round((place - min) / step) * step);
		const value = valueAt(of, of.log ? place : onGrid);
		const { field } = /** @type {Row} */ (rows.get(of.key));
		field.value = written(value);
		bar.ariaValueText = `${written(value)} ${of.unit}`.trim();
		void wish(of.key, value);
	}

	/** What was typed; what is no number, or outside the range, is refused by the server in words. @param {Parameter} of */
	function enter(of) {
		const { field } = /** @type {Row} */ (rows.get(of.key));
		field.defaultValue = field.value;
		const number = Number(field.value.trim().replace(",", ".").replace("−", "-"));
		void wish(of.key, field.value.trim() && !Number.isNaN(number) ? number : field.value);
	}

	/** Help of a parameter, and what it would change, under its row. @param {string} key */
	function unfold(key) {
		const { more, name } = /** @type {Row} */ (rows.get(key));
		more.hidden = !more.hidden;
		name.ariaExpanded = String(!more.hidden);
	}

	const now = (/** @type {string} */ key) => store.get().server?.parameters[key];

	/** Rows in the order of topics: in each the essential ones first, the advanced ones last. */
	function build() {
		const { schema } = store.get();
		if (!schema || rows.size) return;
		const known = [...schema.parameters, ...methodsOf(schema)];
		const rank = (/** @type {Parameter} */ one) => (one.essential ? 0 : one.advanced ? 2 : 1);
		for (const topic of schema.topics.concat(METHODS)) {
			const words = h("span");
			const fold = h(
				"button",
				{
					"aria-expanded": "true",
					onclick: () => {
						fold.ariaExpanded = String(fold.ariaExpanded !== "true");
						list();
					},
				},
				icon("i-down", "s"),
				words,
			);
			const own = known.filter((one) => one.topic === topic).toSorted((a, b) => rank(a) - rank(b));
			const made = own.map(make);
			made.forEach((row) => rows.set(row.of.key, row));
			const body = h(
				"tbody",
				h("tr.topic", h("th", { colspan: 6, scope: "rowgroup" }, fold)),
				made.flatMap(({ row, more }) => [row, more]),
			);
			topics.set(topic, /** @type {any} */ ({ body, words, fold }));
			table.append(body);
		}
	}

	/** Which rows are there: what has an effect now, with the words that are sought. */
	function list() {
		const { server, sought } = store.get();
		if (!server) return;
		const focused = /** @type {HTMLElement} */ (document.activeElement);
		const changed = new Set(server.changed);
		const shown = new Set([...server.shown, ...Object.keys(METHOD_LABELS)]);
		const only = changedOnly.ariaPressed === "true";
		const looks = Boolean(sought.trim() || only);
		const labels = [...rows.values()].flatMap(({ of }) => (shown.has(of.key) ? [of.label] : []));
		for (const { of, name } of rows.values())
			name.classList.toggle("shared", labels.filter((label) => label === of.label).length > 1);
		let count = 0;
		for (const [topic, { body, words, fold }] of topics) {
			const own = [...rows.values()].filter(({ of }) => of.topic === topic && shown.has(of.key));
			const listed = own.filter(
				({ of }) => (!only || changed.has(of.key)) && matches(of, sought.trim()),
			);
			const open = looks || fold.ariaExpanded === "true";
			const there = new Set(open ? listed.map(({ of }) => of.key) : []);
			for (const { of, row, more, name } of rows.values()) {
				if (of.topic !== topic) continue;
				row.hidden = !there.has(of.key);
				more.hidden = row.hidden || name.ariaExpanded !== "true";
			}
			count += listed.length;
			body.hidden = !listed.length;
			const moved = own.filter(({ of }) => changed.has(of.key)).length;
			write(words, `${topic} · ${own.length}${moved ? `, ${moved} changed` : ""}`);
		}
		none.hidden = count > 0;
		write(
			none,
			sought.trim()
				? `No parameter has “${sought.trim()}”${only ? " and is changed" : ""}.`
				: "All parameters stand at their defaults.",
		);
		values();
		// Who reset one that is listed no more goes on at the next.
		if (root.contains(focused) && !focused.checkVisibility()) {
			const stops = all("tr[data-key] .btn.icon", root).filter((one) => one.checkVisibility());
			const after = focused.compareDocumentPosition.bind(focused);
			const next = stops.find((one) => after(one) & Node.DOCUMENT_POSITION_FOLLOWING);
			const own = all("input, select", focused.closest("tr") ?? root).find((one) =>
				one.checkVisibility(),
			);
			root.tabIndex = -1;
			(own ?? next ?? stops.at(-1) ?? root).focus();
		}
	}

	/** What the values are: written where nobody is just moving or typing. */
	function values() {
		const { server, link, sequence } = store.get();
		if (!server) return;
		const changed = new Set(server.changed);
		const locked = link !== "open" || !sequence;
		for (const [key, { of, row, slider, field, reset }] of rows) {
			const value = server.parameters[key];
			row.classList.toggle("changed", changed.has(key));
			reset.hidden = !changed.has(key);
			field.disabled = reset.disabled = locked;
			if (of.kind === "choice") fillChoices(field, of, String(value), server.unfit[key] ?? {});
			if (slider) slider.disabled = locked;
			if (key in wished || key in sent || held === slider) continue;
			if (of.kind === "bool") field.checked = value;
			if (!slider) continue;
			// Who types has a text that is not the value yet.
			if (field !== document.activeElement || field.defaultValue === field.value)
				field.value = field.defaultValue = written(value);
			const [min, max] = placesOf(of, value);
			Object.assign(slider, { min, max, value: placeOf(of, value) });
			const published = store.get().schema?.presets.published?.[key];
			const at = (placeOf(of, Number(published)) - min) / (max - min);
			if (published !== undefined)
				slider.style.setProperty("--published", String(Math.min(1, Math.max(0, at))));
			slider.ariaValueText = `${written(value)} ${of.unit}`.trim();
		}
		drawEffects();
	}

	/** @param {Part} field @param {Parameter} of @param {string} value @param {Record<string, string>} unfit */
	function fillChoices(field, { choices: names }, value, unfit) {
		choices(
			/** @type {any} */ (field),
			names.map((name) => [name, `${written(name)}${name in unfit ? " · not here" : ""}`]),
			value,
		);
		field.title = unfit[value] ?? "";
	}

	function drawEffects() {
		for (const [key, { effect, said }] of rows) {
			const curve = curves.get(key);
			const words = curve ? effectOf(curve) : "";
			const drawn = `${words} ${now(key)}`;
			if (effect.dataset.drawn === drawn) continue;
			effect.dataset.drawn = drawn;
			effect.title = words;
			write(said, words);
			const share = curve?.share ?? null;
			effect.replaceChildren(
				...[
					curve && drawingOf(curve, now(key)),
					share === null ? null : h("span", `${Math.round(100 * share)} %`),
				].filter((one) => one instanceof Element),
			);
		}
	}

	effects.addEventListener("click", () => {
		const listed = [...rows.values()].filter(({ of, row }) => !row.hidden && of.topic !== METHODS);
		const keys = listed.slice(0, MOST_CURVES).map(({ of }) => of.key);
		void actions.ask("POST", "sensitivity", { keys });
	});
	const read = fetcher(async () => {
		const told = /** @type {Server.Changes} */ (await getJson("/api/changes"));
		curves = new Map(told.curves.map((curve) => [curve.key, curve]));
		drawEffects();
	});
	store.watch(["tasks", "server"], ({ tasks: { effects: task } }) => {
		const computing = task?.state === "computing";
		write(effects, computing ? `Effect ${task.done}/${task.total}` : "Effect");
		// Before somebody asks there is none.
		if (task || curves.size) void read();
	});
	find.addEventListener("input", () => store.set({ sought: find.value }));
	find.addEventListener("keydown", (event) => {
		if (event.key !== "Escape") return;
		event.stopPropagation();
		if (find.value) store.set({ sought: "" });
		else find.blur();
	});
	changedOnly.addEventListener("click", () => {
		changedOnly.ariaPressed = String(changedOnly.ariaPressed !== "true");
		list();
	});
	store.watch(["sought"], ({ sought }) => {
		if (find.value !== sought) find.value = sought;
	});

	/* ---------- Presets, and the same run without a browser. */

	presets.addEventListener("change", () => actions.preset(presets.value));
	for (const button of [savePreset, renamePreset]) {
		button.addEventListener("click", () => {
			const old = button === renamePreset ? presets.value : "";
			Object.assign(presetName, { value: old, hidden: false });
			presetName.select();
			presetName.onkeydown = async (event) => {
				event.stopPropagation();
				if (
					event.key === "Enter" &&
					!(await (old
						? actions.renamePreset(old, presetName.value)
						: actions.savePreset(presetName.value)))
				)
					return;
				if (event.key === "Enter" || event.key === "Escape") presets.focus();
			};
		});
	}
	presetName.addEventListener("blur", () => (presetName.hidden = true));
	removePreset.addEventListener("click", () => actions.removePreset(presets.value));

	function foot() {
		const { server, sequence, schema, link } = store.get();
		const locked = link !== "open" || !sequence;
		const [own, now] = [server?.presets ?? [], server?.preset ?? ""];
		choices(
			presets,
			[...(now ? [] : [""]), ...Object.keys(schema?.presets ?? {}), ...own].map((name) => [
				name,
				name || "own values",
			]),
			now,
		);
		presets.disabled = savePreset.disabled = effects.disabled = locked;
		renamePreset.hidden = removePreset.hidden = !own.includes(now);
		resetAll.disabled = locked || !server?.changed.length;
		if (resetAll.disabled && document.activeElement === resetAll) presets.focus();
		write(code, server?.command ?? "");
	}
	store.watch(["schema", "server", "link", "sequence", "sought", "tab"], ({ tab }) => {
		if (tab !== "parameters") return;
		build();
		list();
		foot();
	});
	// Until here a click would have been lost.
	root.inert = false;
}
