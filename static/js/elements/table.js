/** Tables: sorted by their heads, walked by arrows, filled again without losing place or focus. */
import { claim, fill, h, write } from "./dom.js";

/** By which column each table is sorted, by its label: kept while it is drawn anew. @type {Map<string | null, {word?: string, down?: boolean}>} */
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
	return x === y ? 0 : turn * (x - y);
}

/** Put rows in the chosen order. @param {HTMLTableElement} element @param {HTMLTableRowElement[]} rows */
function sort(element, rows) {
	const { word, down = false } = sorted.get(element.ariaLabel) ?? {};
	const heads = [...element.querySelectorAll("th")];
	const at = word ? heads.findIndex(({ dataset }) => dataset.by === word) : -1;
	heads.forEach((head, k) => (head.ariaSort = k !== at ? null : down ? "descending" : "ascending"));
	const value = (/** @type {HTMLTableRowElement} */ { cells }) =>
		cells[at].dataset.by ?? cells[at].textContent ?? "";
	const number = heads[at]?.matches(".num") || Boolean(rows[0]?.cells[at]?.dataset.by);
	if (at >= 0) rows.sort((a, b) => compareCells(value(a), value(b), number, down));
	const [body] = element.tBodies;
	// what is in its place keeps the focus
	rows.forEach((row, k) => body.rows[k] !== row && body.insertBefore(row, body.rows[k] ?? null));
}

/** By a head: from the least, then from the largest. @param {MouseEvent} event */
function sortBy({ currentTarget }) {
	const head = /** @type {HTMLElement} */ (currentTarget).closest("th");
	const element = head?.closest("table");
	if (!head || !element) return;
	const { word, down } = sorted.get(element.ariaLabel) ?? {};
	sorted.set(element.ariaLabel, { word: head.dataset.by, down: word === head.dataset.by && !down });
	sort(element, [...element.tBodies[0].rows]);
}

/**
 * @template R
 * @param {string} label @param {Column<R>[]} columns @param {TableHow<R>} how
 * @returns {Table<R>}
 */
export function table(label, columns, { key, by, down, choose, open, attributes = () => ({}) }) {
	/** @type {Map<string | number, {row: R, element: HTMLTableRowElement}>} */
	const kept = new Map();
	const heads = columns.map(({ word, head = word, kind = "", help, by: value }) =>
		h(
			"th",
			{ scope: "col", class: kind, title: help, "data-by": value && word },
			value ? h("button", { onclick: sortBy }, head) : word ? head : h("span.vh", "Actions"),
		),
	);
	const body = h("tbody");
	const element = h("table", { "aria-label": label }, h("thead", h("tr", heads)), body);
	if (by) sorted.set(label, { word: by, down });

	/** @param {Element} cell  @param {any} value */
	function put(cell, value) {
		if (typeof value === "string" || typeof value === "number") write(cell, String(value));
		else fill(cell, ...[value].flat());
	}

	/** @param {R} row */
	function make(row) {
		const entry = { row, element: h("tr") };
		/** @param {KeyboardEvent} event */
		function press(event) {
			const { key, target } = event;
			const { element } = entry;
			if (target !== element) return;
			if (key === "Enter") choose?.(entry.row, event);
			const next =
				key === "ArrowDown"
					? element.nextElementSibling
					: key === "ArrowUp" && element.previousElementSibling;
			if (!(next instanceof HTMLElement)) return;
			claim(event);
			next.focus();
		}
		entry.element = h(
			"tr",
			{
				...(choose && {
					tabindex: -1,
					onclick: (event) => choose(entry.row, event),
					onkeydown: press,
					// One stop of the Tab key for the whole table: the row that had the focus last.
					onfocus: () => {
						for (const other of body.rows) other.tabIndex = other === entry.element ? 0 : -1;
					},
				}),
				ondblclick: open && (() => open(entry.row)),
				...attributes(row),
			},
			columns.map(({ kind = "" }) => h("td", { class: kind })),
		);
		return entry;
	}

	return {
		element,
		show(rows) {
			const keys = new Set(rows.map(key));
			for (const [name, { element }] of kept)
				if (!keys.has(name)) (element.remove(), kept.delete(name));
			const shown = rows.map((row) => {
				const entry = kept.get(key(row)) ?? make(row);
				kept.set(key(row), entry);
				entry.row = row;
				columns.forEach(({ cell, by: value }, place) => {
					const there = entry.element.cells[place];
					put(there, cell(row));
					if (value instanceof Function) there.dataset.by = String(value(row));
				});
				return entry.element;
			});
			sort(element, shown);
			if (choose && body.rows[0] && ![...body.rows].some((row) => row.tabIndex === 0))
				body.rows[0].tabIndex = 0;
		},
		live() {
			for (const { row, element } of kept.values())
				columns.forEach(({ cell, live }, place) => live && put(element.cells[place], cell(row)));
		},
		each(act) {
			for (const { row, element } of kept.values()) act(row, element);
		},
	};
}
