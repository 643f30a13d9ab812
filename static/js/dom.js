// @ts-check
/** Building elements. */
import { COMMANDS, keyLabel } from "./commands.js";

/** @typedef {Node | string | number | null | undefined | false} Child */

/**
 * An element with attributes and children. `on…` is a listener, `class` and the rest are
 * attributes; `true` sets an empty one, `false` and `null` none; `--x` is a style property.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Record<string, any>} [attributes]
 * @param {...(Child | Child[])} children
 */
export function h(tag, attributes = {}, ...children) {
	const element = document.createElement(tag);
	for (const [name, value] of Object.entries(attributes)) {
		if (value === null || value === undefined || value === false) continue;
		if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
		else if (name.startsWith("--")) element.style.setProperty(name, value);
		else element.setAttribute(name, value === true ? "" : String(value));
	}
	fill(element, ...children);
	return element;
}

/**
 * Replace what an element holds.
 * @param {Element} element
 * @param {...(Child | Child[])} children
 */
export function fill(element, ...children) {
	const nodes = children.flat().filter((child) => child !== null && child !== undefined && child !== false);
	element.replaceChildren(.../** @type {(Node | string)[]} */ (nodes.map((n) => (typeof n === "number" ? String(n) : n))));
}

/**
 * Write a text only where it changed: cheap enough for every frame.
 * @param {Node} node
 * @param {string} text
 */
export function write(node, text) {
	if (node.textContent !== text) node.textContent = text;
}

/**
 * @param {string} name  of a symbol in the page, `i-…` for icons, `l-…` for legends
 * @param {string} [kind]  further classes
 * @param {string} [box]
 */
export function icon(name, kind = "", box = "") {
	const ns = "http://www.w3.org/2000/svg";
	const svg = document.createElementNS(ns, "svg");
	svg.setAttribute("class", name.startsWith("l-") ? "" : `i ${kind}`);
	svg.setAttribute("aria-hidden", "true");
	if (box) svg.setAttribute("viewBox", box);
	const use = document.createElementNS(ns, "use");
	use.setAttribute("href", `#${name}`);
	svg.append(use);
	return svg;
}

/**
 * The coloured number of a track. Colour follows the id and never the rank.
 * @param {number} id
 */
export function idTag(id) {
	const n = colourIndex(id);
	return h("span", { class: "id", "--c": `var(--id-${n})`, "--on-id": `var(--on-${n})` }, id);
}

/**
 * @param {number} id
 * @returns {number} 1 … 24
 */
export function colourIndex(id) {
	return ((((id - 1) % 24) + 24) % 24) + 1;
}

/**
 * Attributes of a control that does what a command does: its tooltip and its key.
 * @param {string} name
 * @param {string} [tip]  where the title says too much
 */
export function tipOf(name, tip) {
	const command = COMMANDS.find((c) => c.name === name);
	return { "data-tip": tip ?? command?.title ?? "", "data-key": command ? keyLabel(command.keys[0]) : "" };
}

/**
 * A symbol such as `p_S` or `J_max` with its index lowered.
 * @param {string} symbol
 */
export function symbolNodes(symbol) {
	const [base, index] = symbol.split("_");
	return [h("i", {}, base), ...(index ? [h("sub", {}, index)] : [])];
}

/**
 * @param {unknown} value
 * @returns {string} a number as short as it stays readable
 */
export function show(value) {
	if (typeof value === "boolean") return value ? "on" : "off";
	if (typeof value !== "number") return value === null || value === undefined ? "–" : String(value);
	if (Number.isInteger(value)) return String(value);
	return Math.abs(value) < 1e-3 ? value.toExponential().replace("e-", "e−") : String(Number(value.toPrecision(5)));
}

/**
 * A chooser: a native select with the look of the page.
 * @param {object} how
 * @param {string} how.label
 * @param {boolean} [how.box]
 * @param {string} [how.word]  printed before the value
 * @param {(value: string) => void} how.choose
 */
export function chooser({ label, box = false, word = "", choose }) {
	const select = h("select", {
		"aria-label": label,
		onchange: () => {
			choose(select.value);
			select.blur();
		},
	});
	const root = h("label", { class: box ? "chooser box" : "chooser" }, word && h("span", { class: "k opt-2" }, word), select, icon("i-down", "s"));
	return { root, select };
}
