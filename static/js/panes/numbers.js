/* ---------- Numbers of viser's panel count when they are finished: it takes each letter for a
   number, and a 0 on the way to 0.9 for the least one that is allowed ---------- */

const FIELD = ".mantine-NumberInput-input";

/** Keys that end a number, or change it by a step. */
const ENDS = ["Enter", "ArrowUp", "ArrowDown"];

/** Have the fields of a document keep what is typed until it is finished; Escape takes it back. @param {Document} page */
export function takeWholeNumbers(page) {
	let passing = false;
	let before = "";
	/** @param {Event} event */
	const fieldOf = ({ target }) => {
		const element = /** @type {HTMLInputElement} */ (target);
		return element.matches?.(FIELD) ? element : null;
	};
	/** @param {HTMLInputElement} field */
	const pass = (field) => {
		passing = true;
		field.dispatchEvent(new Event("input", { bubbles: true }));
		passing = false;
		before = field.value;
	};
	page.addEventListener("focusin", (event) => (before = fieldOf(event)?.value ?? ""), true);
	page.addEventListener(
		"input",
		(event) => {
			if (!passing && fieldOf(event)) event.stopImmediatePropagation();
		},
		true,
	);
	page.addEventListener(
		"keydown",
		(event) => {
			const field = fieldOf(event);
			if (!field) return;
			if (ENDS.includes(event.key)) pass(field);
			if (event.key === "Escape") field.value = before;
		},
		true,
	);
	page.addEventListener(
		"focusout",
		(event) => {
			const field = fieldOf(event);
			if (field) pass(field);
		},
		true,
	);
}
