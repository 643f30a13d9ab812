/** Panels that are drawn anew while somebody works in them, and what they are written with. */
import { all, h, symbolParts } from "./dom.js";

/** Elements that are replaced as a whole where they differ: what they do is made with what they say. */
const CONTROLS = "button, a, input, select";

/**
 * Bring children to what they shall be; those that are the same stay, with what is typed in them.
 * @param {Element} there @param {Element | DocumentFragment} wanted
 */
function adapt(there, wanted) {
	const next = [...wanted.childNodes];
	for (const [place, node] of next.entries()) {
		const old = there.childNodes[place];
		if (!old) there.append(node);
		else if (old.isEqualNode(node)) continue;
		else if (
			old instanceof Element &&
			node instanceof Element &&
			!node.matches(CONTROLS) &&
			old.cloneNode().isEqualNode(node.cloneNode())
		)
			adapt(old, node);
		else old.replaceWith(node);
	}
	while (there.childNodes.length > next.length) there.lastChild?.remove();
}

/** By what a control is found again where another stands in its place. @param {Part} control */
const called = ({ id, ariaLabel, form, textContent }) =>
	id || ariaLabel || `${form?.ariaLabel ?? ""} ${textContent}`;

/**
 * Draw anew what somebody may be working in. What is as it was is not touched: what is typed stays
 * as long as the value under it does. A control that is replaced hands its focus to the one of its
 * name, else to the one in its place, to the last one, or to the panel.
 * @param {HTMLElement} root
 * @param {...(Child | Child[])} children
 */
export function redraw(root, ...children) {
	const held = all(":focus", root)[0];
	const stops = `${CONTROLS}, [tabindex]`;
	const at = all(stops, root).indexOf(held);
	adapt(root, h("div", {}, ...children));
	if (!held || held.isConnected) return;
	const now = all(stops, root);
	const next = now.find((control) => called(control) === called(held)) ?? now[at] ?? now.at(-1);
	if (next) return next.focus();
	const panel = /** @type {HTMLElement} */ (root.closest("[role=tabpanel]") ?? root);
	panel.tabIndex = -1;
	panel.focus();
}

/** A parameter: its words with its symbol; what it means comes with the pointer. @param {Server.ParameterInfo} of */
export function parameterName({ label, symbol, help }) {
	const [letter, index] = symbolParts(symbol);
	return h("span", { title: help }, `${label} `, h("i", {}, letter), index);
}

/** Text in a muted colour. @param {...(Child | Child[])} children */
export const quiet = (...children) => h("span", { class: "q" }, ...children);

/** A line of words above or below a table. @param {...(Child | Child[])} children */
export const line = (...children) => h("p", { class: "words" }, ...children);

/** What stands where there is nothing to list. @param {string} title @param {string} text */
export const nothing = (title, text) =>
	h("div", { class: "blank" }, h("h3", {}, title), h("p", {}, text));

/**
 * A number with fixed digits and a true minus; a dash where there is none.
 * @param {number | null | undefined} value @param {number} digits @param {boolean} [signed]
 */
export function fixed(value, digits, signed = false) {
	if (value === null || value === undefined) return "–";
	const text = Math.abs(value).toFixed(digits);
	return `${!Number(text) ? "" : value < 0 ? "−" : signed ? "+" : ""}${text}`;
}

/** By which column each table is sorted, by its label: kept while it is drawn anew. @type {Map<string, {word: string, down: boolean}>} */
const sorted = new Map();

/**
 * The order of two cells: numbers by their value, those that are none last, other text by letters.
 * @param {string} a @param {string} b @param {boolean} number @param {boolean} down
 */
export function compareCells(a, b, number, down) {
	const turn = down ? -1 : 1;
	if (!number) return turn * a.localeCompare(b, "en", { numeric: true });
	const [x, y] = [a, b].map((text) => Number.parseFloat(text.replace("−", "-")));
	if (Number.isNaN(x) || Number.isNaN(y)) return Number(Number.isNaN(x)) - Number(Number.isNaN(y));
	return turn * (x - y);
}

/** Bring the rows into the chosen order. @param {HTMLTableElement} element */
function sortRows(element) {
	const { word, down } = sorted.get(element.ariaLabel ?? "") ?? { word: "", down: false };
	const heads = [...element.querySelectorAll("th")];
	const at = heads.findIndex(({ textContent }) => textContent === word);
	heads.forEach((head, k) => (head.ariaSort = k !== at ? null : down ? "descending" : "ascending"));
	if (at < 0) return;
	const text = (/** @type {HTMLTableRowElement} */ row) => row.cells[at].textContent ?? "";
	const number = heads[at].className === "num";
	const [body] = element.tBodies;
	body.append(...[...body.rows].sort((a, b) => compareCells(text(a), text(b), number, down)));
}

/** By a head: from the least, then from the largest. @param {MouseEvent} event */
function sortBy({ currentTarget }) {
	const button = /** @type {HTMLElement} */ (currentTarget);
	const element = /** @type {HTMLTableElement} */ (button.closest("table"));
	const [label, word] = [element.ariaLabel ?? "", button.textContent ?? ""];
	const before = sorted.get(label);
	sorted.set(label, { word, down: before?.word === word && !before.down });
	sortRows(element);
}

/** A click anywhere in a row is one on its first button. @param {MouseEvent} event */
function pressFirst({ currentTarget, target }) {
	const row = /** @type {HTMLElement} */ (currentTarget);
	if (!(/** @type {HTMLElement} */ (target).closest(CONTROLS)))
		row.querySelector("button")?.click();
}

/**
 * A table that is made once: one of several below each other.
 * @param {string} label
 * @param {string[]} words  of the columns; a `#` in front means numbers, at the right
 * @param {(Child | Child[])[][]} rows  a cell a column; a dash stands for null
 * @param {object} [how]
 * @param {boolean} [how.sorts]  by its heads: its rows have no order of their own
 * @param {boolean} [how.goes]  a row does as a whole what its first button does
 */
export function table(label, words, rows, { sorts = false, goes = false } = {}) {
	const kinds = words.map((word) => ({ class: word.startsWith("#") ? "num" : "" }));
	const heads = words.map((head, k) => {
		const word = head.replace("#", "");
		return h(
			"th",
			{ scope: "col", ...kinds[k] },
			!word
				? h("span", { class: "vh" }, "Actions")
				: sorts
					? h("button", { onclick: sortBy }, word)
					: word,
		);
	});
	const lines = rows.map((row) =>
		h(
			"tr",
			goes ? { class: "goes", onclick: pressFirst } : {},
			row.map((cell, k) => h("td", kinds[k], cell ?? "–")),
		),
	);
	const element = h(
		"table",
		{ "aria-label": label },
		h("thead", {}, h("tr", {}, heads)),
		h("tbody", {}, lines),
	);
	if (sorts) sortRows(element);
	return element;
}
