// @ts-check
/** What differs from the defaults: each with its reset, and all of it as a command. */
import { chooser, fill, h, icon, show, symbolNodes, tipOf } from "../dom.js";

/**
 * The command line that makes the same run.
 * @param {string} sequence
 * @param {Record<string, any>} parameters
 * @param {string[]} changed
 */
export function commandLine(sequence, parameters, changed) {
	const quote = (/** @type {string} */ text) => (/^[\w./+-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`);
	const methods = [];
	if (parameters.single_view !== undefined) methods.push(`--single-view ${quote(String(parameters.single_view))}`);
	if (parameters.fusion_method !== undefined) methods.push(`--fusion ${quote(String(parameters.fusion_method))}`);
	const sets = changed.filter((key) => key.includes(".")).map((key) => `--set ${key}=${quote(String(parameters[key]))}`);
	return ["multiview-phd track", quote(sequence), "-o tracks.csv", ...methods, ...sets].join(" ");
}

/** @param {HTMLElement} root @param {Context} context */
export function mountChanges(root, { store, page, actions }) {
	const body = h("tbody", {});
	const head = h("tr", {}, ["Stage", "Parameter"].map((word) => h("th", { scope: "col" }, word)), ["Default", "Now", ""].map((word) => h("th", { scope: "col", class: "num" }, word)));
	const table = h("div", { class: "scroll" }, h("table", { "aria-label": "Changed parameters" }, h("thead", {}, head), body));
	const nothing = h("div", { class: "scroll", hidden: true }, h("div", { class: "blank" }, h("h3", {}, "All parameters stand at their defaults"), h("p", {}, "Move a slider in the panel of the 3D view; what differs is listed here.")));
	const presets = chooser({ label: "Preset", box: true, choose: page.preset });
	const resetAll = h("button", { class: "btn up end", "data-tip": "All to their defaults", onclick: () => page.reset() }, icon("i-reset", "s"), "Reset all");
	const undo = h("button", { class: "btn up end", ...tipOf("undo", "Undo the last change"), onclick: actions.undo }, "Undo");
	const code = h("code", {});
	const copied = (/** @type {HTMLButtonElement} */ button, /** @type {string} */ word, /** @type {() => string} */ text) => {
		button.addEventListener("click", async () => {
			const done = await page.copy(text());
			const label = button.lastChild;
			if (!label) return;
			label.textContent = done ? "Copied" : "Not allowed";
			setTimeout(() => (label.textContent = word), 1200);
		});
		return button;
	};
	const line = () => {
		const { server } = store.get();
		return server?.sequence ? commandLine(server.sequence.name, server.parameters, server.changed) : "";
	};
	const json = () => {
		const { server } = store.get();
		return JSON.stringify(Object.fromEntries((server?.changed ?? []).map((key) => [key, server?.parameters[key]])), null, 2);
	};
	root.append(
		table,
		nothing,
		h("div", { class: "foot" }, h("span", {}, "preset"), presets.root, h("span", { class: "grow" }), undo, resetAll),
		h(
			"div",
			{ class: "foot" },
			code,
			h("span", { class: "grow" }),
			copied(h("button", { class: "btn up end", "data-tip": "Copy as a command line" }, icon("i-copy", "s"), h("span", {}, "Copy")), "Copy", line),
			copied(h("button", { class: "btn up end", "data-tip": "Copy what differs as JSON" }, h("span", {}, "JSON")), "JSON", json),
		),
	);

	function render() {
		const { server, schema, link } = store.get();
		const changed = server?.changed ?? [];
		table.hidden = changed.length === 0;
		nothing.hidden = changed.length > 0;
		const locked = link !== "open";
		resetAll.toggleAttribute("disabled", locked || changed.length === 0);
		fill(
			body,
			changed.map((key) => {
				const parameter = schema?.parameters.find((p) => p.key === key);
				const group = key.includes(".") ? key.split(".")[0] : "method";
				const name = parameter
					? [`${parameter.label} `, ...symbolNodes(parameter.symbol)]
					: key.replaceAll("_", " ");
				const unit = parameter?.unit ? ` ${parameter.unit}` : "";
				return h(
					"tr",
					{ title: parameter?.help ?? "" },
					h("td", { class: "q" }, group),
					h("td", {}, name),
					h("td", { class: "num q" }, parameter ? show(parameter.default) : "what fits"),
					h("td", { class: "num" }, show(server?.parameters[key]), unit && h("span", { class: "q opt-1" }, unit)),
					h("td", { class: "num" }, h("button", { class: "btn", disabled: locked, "aria-label": `Reset ${parameter?.label ?? key}`, onclick: () => page.reset(key) }, icon("i-reset", "s"), "reset")),
				);
			}),
		);
		const names = Object.keys(schema?.presets ?? {});
		const fits = names.find((name) => {
			const values = schema?.presets[name] ?? {};
			const numbers = changed.filter((key) => key.includes("."));
			return Object.entries(values).every(([key, value]) => server?.parameters[key] === value) && numbers.every((key) => key in values);
		});
		fill(presets.select, !fits && h("option", { value: "", disabled: true }, "own values"), names.map((name) => h("option", { value: name }, name)));
		presets.select.value = fits ?? "";
		presets.select.disabled = locked || names.length === 0;
		code.textContent = line();
	}

	store.on(["server", "schema", "link"], render);
	render();
}
