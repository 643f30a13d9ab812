/** Tables: sorted by their heads, walked by arrows, filled again without losing place or focus. */
import { fill, h, write } from "./dom.js";

/**
 * @template R
 * @param {string} label
 * @param {Column<R>[]} columns
 * @param {object} how
 * @param {(row: R) => string | number} how.key
 * @param {string} [how.by] word of the column that sorts at first; without one rows stay in their
 * order
 * @param {boolean} [how.down]  from the largest
 * @param {(row: R, event: MouseEvent | KeyboardEvent) => void} [how.choose]  by click or Enter
 * @param {(row: R) => void} [how.open]  by double click
 * @param {(row: R) => Record<string, any>} [how.attributes]  of the row, and its listeners
 * @returns {Grid<R>}
 */
export function grid(
	label,
	columns,
	{ key, by = "", down = false, choose, open, attributes = () => ({}) },
) {
	/** @type {R[]} */
	let rows = [];
	/** @type {Map<string | number, {row: R, element: HTMLTableRowElement}>} */
	const kept = new Map();
	const heads = columns.map(({ word, kind = "", help, by: value }) =>
		h(
			"th",
			{ scope: "col", class: kind, title: help },
			value
				? h("button", { onclick: () => sort(word) }, word)
				: word || h("span", { class: "vh" }, "Actions"),
		),
	);
	const body = h("tbody");

	/** @param {string} word */
	function sort(word) {
		down = by === word && !down;
		by = word;
		show(rows);
	}

	/** @param {Element} cell  @param {any} value */
	function put(cell, value) {
		if (typeof value === "string" || typeof value === "number") write(cell, String(value));
		else fill(cell, value);
	}

	/** @param {R} first */
	function make(first) {
		const entry = {
			row: first,
			element: h(
				"tr",
				{ ...attributes(first) },
				columns.map(({ kind = "" }) => h("td", { class: kind })),
			),
		};
		const { element } = entry;
		if (choose) {
			element.tabIndex = -1;
			element.addEventListener("click", (event) => choose(entry.row, event));
			element.addEventListener("keydown", (event) => {
				if (event.target !== element) return;
				if (event.key === "Enter") choose(entry.row, event);
				const next =
					event.key === "ArrowDown"
						? element.nextElementSibling
						: event.key === "ArrowUp"
							? element.previousElementSibling
							: null;
				if (!(next instanceof HTMLElement)) return;
				event.preventDefault();
				event.stopPropagation();
				next.focus();
			});
			// One stop of the Tab key for the whole table: the row that had the focus last.
			element.addEventListener("focus", () => {
				for (const other of body.rows) other.tabIndex = other === element ? 0 : -1;
			});
		}
		if (open) element.addEventListener("dblclick", () => open(entry.row));
		return entry;
	}

	/** @param {R[]} next */
	function show(next) {
		rows = next;
		const value = columns.find(({ word }) => word === by)?.by;
		const turn = down ? -1 : 1;
		const compare = (/** @type {string | number} */ a, /** @type {string | number} */ b) =>
			turn * (typeof a === "string" ? a.localeCompare(String(b)) : a - Number(b));
		const sorted = value ? [...rows].sort((a, b) => compare(value(a), value(b))) : rows;
		const keys = new Set(rows.map(key));
		for (const [name, { element }] of kept)
			if (!keys.has(name)) (element.remove(), kept.delete(name));
		sorted.forEach((row, index) => {
			const entry = kept.get(key(row)) ?? make(row);
			kept.set(key(row), entry);
			entry.row = row;
			columns.forEach(({ cell }, place) => put(entry.element.cells[place], cell(row)));
			if (body.rows[index] !== entry.element)
				body.insertBefore(entry.element, body.rows[index] ?? null);
		});
		heads.forEach((head, index) => {
			head.ariaSort =
				value && columns[index].word === by ? (down ? "descending" : "ascending") : null;
		});
		if (choose && body.rows[0] && ![...body.rows].some((row) => row.tabIndex === 0))
			body.rows[0].tabIndex = 0;
	}

	return {
		element: h(
			"div",
			{ class: "scroll" },
			h("table", { "aria-label": label }, h("thead", {}, h("tr", {}, heads)), body),
		),
		show,
		live() {
			for (const { row, element } of kept.values())
				columns.forEach(({ cell, live }, place) => live && put(element.cells[place], cell(row)));
		},
		each(act) {
			for (const { row, element } of kept.values()) act(row, element);
		},
	};
}
