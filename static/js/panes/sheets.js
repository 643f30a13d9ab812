/** The two dialogs made from the registry of commands: help with its keys, and the palette. */
import { COMMANDS, keyLabel, perform, search } from "../state/commands.js";
import { all, fill, h, parts } from "../elements/dom.js";

/** @param {string[]} keys */
const signs = (keys) => keys.map((key) => h("kbd", {}, keyLabel(key)));

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
			"div",
			{ class: "key-row" },
			cameras ? "Camera 1 to 9 large, again: all alike" : title,
			h("span", { class: "grow" }),
			cameras ? [...signs(["1"]), "–", ...signs(["9"])] : signs(keys),
		);
	};
	const listed = COMMANDS.filter(({ name, keys }) => keys.length && !/^camera-[2-9]$/.test(name));
	fill(
		sheet,
		[...new Set(listed.map(({ group }) => group))].map((group) =>
			h("section", {}, h("h3", {}, group), listed.filter((c) => c.group === group).map(row)),
		),
	);
	single.addEventListener("change", () => store.set({ singleKeys: single.checked }));
	actions.help = () => {
		if (help.open) return help.close();
		single.checked = store.get().singleKeys;
		help.showModal();
	};

	let at = 0;
	/** @type {Command[]} */
	let found = [];
	function offer() {
		found = search(input.value);
		at = Math.max(0, Math.min(at, found.length - 1));
		const option = (/** @type {Command} */ command, /** @type {number} */ index) =>
			h(
				"div",
				{
					class: "key-row",
					role: "option",
					id: `option-${index}`,
					"aria-selected": String(index === at),
					onclick: () => run(command),
					onpointermove: () => index !== at && choose(index),
				},
				command.title,
				h("span", { class: "grow" }),
				signs(command.keys.slice(0, 1)),
			);
		fill(list, found.length ? found.map(option) : h("p", {}, "No command has these words."));
		choose(at);
	}
	/** @param {number} index */
	function choose(index) {
		at = index;
		all("[role=option]", list).forEach((option, k) => (option.ariaSelected = String(k === at)));
		input.setAttribute("aria-activedescendant", found.length ? `option-${at}` : "");
		list.children[at]?.scrollIntoView({ block: "nearest" });
	}
	/** @param {Command} command */
	function run(command) {
		palette.close();
		perform(command, actions);
	}
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
		input.value = "";
		at = 0;
		palette.showModal();
		offer();
	};
}
