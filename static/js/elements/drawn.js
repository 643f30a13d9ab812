/** Panels that are drawn anew while somebody works in them, and what they are written with. */
import { all, choices, h, icon } from "./dom.js";
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

/**
 * A list of choices of its own.
 * @param {string} label
 * @param {(string | number)[][]} words  values and words
 * @param {string | number} chosen
 * @param {(value: string) => void} choose
 */
export function chooser(label, words, chosen, choose) {
	const select = h("select.field", {
		"aria-label": label,
		onchange: () => choose(select.value),
	});
	choices(select, words, chosen);
	return select;
}

/**
 * Buttons beside each other, one of them pressed.
 * @template V
 * @param {readonly (readonly [V, Child, string?])[]} words  values, words and what the pointer says
 * @param {V} chosen
 * @param {(value: V) => void} choose
 */
export const segment = (words, chosen, choose) =>
	words.map(([value, word, title]) =>
		h(
			"button",
			{ "aria-pressed": String(value === chosen), title, onclick: () => choose(value) },
			word,
		),
	);

/** What takes the room that is left. */
export const grow = () => h("span.grow");

/** @param {Child | Node} title  a heading or its words @param {...(Child | Child[])} beside */
export const paneHead = (title, ...beside) =>
	h("div.pane-head", title instanceof Element ? title : h("h2.pane-title", title), ...beside);

/**
 * A button that is a sign alone.
 * @param {string} sign @param {string} label @param {() => void} onclick @param {Attributes} [more]
 */
export const signButton = (sign, label, onclick, more = {}) =>
	h("button.btn.icon", { "aria-label": label, onclick, ...more }, icon(sign, "s"));

/**
 * Have a text written in a field: Enter takes it, Escape and leaving the field do not, unless they
 * are told to.
 * @param {Attributes & {value: string}} attributes
 * @param {(text: string | null) => void} done  null where it is not taken
 * @param {boolean} [leaves]  leaving the field takes it
 */
export function asks(attributes, done, leaves = false) {
	let over = false;
	const end = (/** @type {boolean} */ taken) => {
		if (over) return;
		over = true;
		done(taken ? field.value : null);
	};
	const field = h("input.field", {
		...attributes,
		onblur: () => end(leaves),
		onkeydown: (event) => {
			event.stopPropagation();
			if (event.key === "Enter" || event.key === "Escape") end(event.key === "Enter");
		},
	});
	return field;
}

/** Have the browser save a file. @param {Blob} blob @param {string} name */
export function save(blob, name) {
	const href = URL.createObjectURL(blob);
	h("a", { href, download: name }).click();
	setTimeout(() => URL.revokeObjectURL(href), 10_000);
}

/** The place of a key among the arrows: what it adds across and down. @type {Record<string, [number, number] | undefined>} */
export const ARROWS = {
	ArrowLeft: [-1, 0],
	ArrowRight: [1, 0],
	ArrowUp: [0, -1],
	ArrowDown: [0, 1],
};

/** A symbol with indices set low; a method's key is words. @param {string} symbol  such as p_D or σ_z/σ_x */
export function symbolParts(symbol) {
	if (!/^.{1,4}_/.test(symbol)) return [symbol.replaceAll("_", " ")];
	return symbol.split(/_([^/()+]+)/).map((part, k) => (k % 2 ? h("sub", part) : part));
}

/** @param {string} symbol */
export const symbolOf = (symbol, kind = "sym") =>
	h("span", { class: kind }, ...symbolParts(symbol));

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
