/** Panels that are drawn anew while somebody works in them, and what they are written with. */
import { all, h, symbolParts } from "./dom.js";
import { table } from "./table.js";

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
	adapt(root, h("div", ...children));
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
	return h("span", { title: help }, `${label} `, h("i", ...symbolParts(symbol)));
}

/** Text in a muted colour. @param {...(Child | Child[])} children */
export const quiet = (...children) => h("span.q", ...children);

/** A line of words above or below a table. @param {...(Child | Child[])} children */
export const line = (...children) => h("p.words", ...children);

/** What stands where there is nothing to list. @param {string} title @param {string} text */
export const nothing = (title, text) => h("div.blank", h("h3", title), h("p", text));

/**
 * A number with fixed digits and a true minus; a dash where there is none.
 * @param {number | null | undefined} value @param {number} digits @param {boolean} [signed]
 */
export function fixed(value, digits, signed = false) {
	if (value === null || value === undefined) return "–";
	const text = Math.abs(value).toFixed(digits);
	return `${!Number(text) ? "" : value < 0 ? "−" : signed ? "+" : ""}${text}`;
}

/** A click anywhere in a row is one on its first button. @param {MouseEvent} event */
function pressFirst({ currentTarget, target }) {
	const row = /** @type {HTMLElement} */ (currentTarget);
	if (!(/** @type {HTMLElement} */ (target).closest(CONTROLS)))
		row.querySelector("button")?.click();
}

/**
 * A table that a panel draws anew whenever something changes.
 * @param {string} label
 * @param {string[]} words  of the columns; a `#` in front means numbers, at the right
 * @param {(Child | Child[])[][]} rows  a cell a column; a dash stands for null
 * @param {object} [how]
 * @param {boolean} [how.sorts]  by its heads: its rows have no order of their own
 * @param {boolean} [how.goes]  a row does as a whole what its first button does
 */
export function drawnTable(label, words, rows, { sorts = false, goes = false } = {}) {
	const columns = words.map((head, k) => ({
		word: head.replace("#", ""),
		kind: head.startsWith("#") ? "num" : "",
		by: sorts && head !== "#",
		cell: (/** @type {number} */ row) => rows[row][k] ?? "–",
	}));
	const { element, show } = table(label, columns, {
		key: Number,
		attributes: () => (goes ? { class: "goes", onclick: pressFirst } : {}),
	});
	show([...rows.keys()]);
	return element;
}
