// @ts-check
/** What differs from the defaults: each with its reset, and all of it as a command. */
import { choices, h, icon, parts, show, symbolNodes } from "../dom.js";
import { grid } from "../grid.js";
import { commandLine } from "../url.js";

/** @type {Pane} */
export function mountChanges(root, { store, actions }) {
	const { nothing, presets, resetAll, code } = parts(root);
	const known = (/** @type {string} */ key) => store.get().schema?.parameters.find((p) => p.key === key);
	const unit = (/** @type {string} */ key) => known(key)?.unit;
	/** @type {Column<string>[]} */
	const columns = [
		{ word: "Stage", kind: "q", cell: (key) => show(key.includes(".") ? key.split(".")[0] : "method") },
		{ word: "Parameter", cell: (key) => [`${known(key)?.label ?? show(key)} `, ...symbolNodes(known(key)?.symbol ?? "")] },
		{ word: "Default", kind: "num q", cell: (key) => (known(key) ? show(known(key)?.default) : "what fits") },
		{ word: "Now", kind: "num", cell: (key) => [show(store.get().server?.parameters[key]), unit(key) && h("span", { class: "q opt-1" }, ` ${unit(key)}`)] },
		{
			word: "",
			kind: "num",
			cell: (key) => h("button", { class: "btn", disabled: store.get().link !== "open", "aria-label": `Reset ${known(key)?.label ?? show(key)}`, onclick: () => actions.reset(key) }, icon("i-reset", "s"), "reset"),
		},
	];
	const table = grid("Changed parameters", columns, { key: (key) => key, attributes: (key) => ({ title: known(key)?.help ?? "" }) });
	root.prepend(table.element);
	presets.addEventListener("change", () => actions.preset(presets.value));

	function render() {
		const { server, schema, link } = store.get();
		const changed = server?.changed ?? [];
		const locked = link !== "open" || !server?.sequence;
		table.show(changed);
		table.element.hidden = changed.length === 0;
		nothing.hidden = changed.length > 0;
		resetAll.disabled = locked || changed.length === 0;
		const fits = Object.entries(schema?.presets ?? {}).find(
			([, values]) => Object.entries(values).every(([key, value]) => server?.parameters[key] === value) && changed.every((key) => key in values || !key.includes(".")),
		);
		const names = Object.keys(schema?.presets ?? {});
		choices(presets, [...(fits ? [] : /** @type {[string, string][]} */ ([["", "own values"]])), ...names.map((name) => /** @type {[string, string]} */ ([name, name]))], fits?.[0] ?? "");
		presets.disabled = locked;
		code.textContent = server?.sequence ? commandLine(server.sequence.name, server.parameters, changed) : "";
	}

	store.on(["server", "schema", "link"], render);
	render();
}
