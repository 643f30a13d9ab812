/**
 * A box over a picture without a pointer: arrows move it, with Ctrl they size it, with Shift they go
 * further; Enter keeps it.
 */
import { lensOf } from "../draw/picture.js";
import { h } from "../elements/dom.js";
import { resultOf } from "../state/events.js";

/** Of a press of an arrow, pixels of the picture. */
const [SMALL, LARGE] = [1, 10];

/** Sides of a box are no shorter than this, pixels of the picture. */
const LEAST = 4;

/** @typedef {{left: number, top: number, width: number, height: number}} Sides */

/**
 * @param {HTMLElement} mosaic  the pictures
 * @param {Store<PageState>} store
 * @param {object} does
 * @param {(cell: HTMLElement, sides: Sides) => void} does.keep
 * @param {(words: string) => void} does.tell  where the box is
 */
export function mountFrame(mosaic, store, { keep, tell }) {
	/** @type {{cell: HTMLElement, index: number, sides: Sides} | null} */
	let at = null;
	const frame = h("button", { class: "drawn framed", onkeydown: keyed });

	/** In a picture, around the selected person where it is seen there. @param {HTMLElement} cell */
	function begin(cell) {
		const index = [...mosaic.children].indexOf(cell);
		const camera = store.get().cameras[index];
		if (!camera) return;
		const found = resultOf(store.get())?.cameras[index]?.tracks.find(
			({ id, visible }) => visible && id === store.get().selection,
		)?.box;
		const [left, top, width, height] = found ?? [
			camera.width * 0.45,
			camera.height * 0.3,
			camera.width * 0.1,
			camera.height * 0.4,
		];
		at = { cell, index, sides: { left, top, width, height } };
		// Beside the pictures, which are buttons themselves.
		mosaic.after(frame);
		put();
		frame.focus();
	}

	function end() {
		at = null;
		frame.remove();
	}

	/** @param {KeyboardEvent} event */
	function keyed(event) {
		if (!at) return;
		const { sides, index } = at;
		const { width: wide, height: high } = store.get().cameras[index];
		const far = event.shiftKey ? LARGE : SMALL;
		const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[
			event.key
		];
		const within = (
			/** @type {number} */ value,
			/** @type {number} */ least,
			/** @type {number} */ most,
		) => Math.round(Math.max(least, Math.min(most, value)) * 10) / 10;
		if (way && (event.ctrlKey || event.metaKey)) {
			sides.width = within(sides.width + far * way[0], LEAST, wide - sides.left);
			sides.height = within(sides.height + far * way[1], LEAST, high - sides.top);
		} else if (way) {
			sides.left = within(sides.left + far * way[0], 0, wide - sides.width);
			sides.top = within(sides.top + far * way[1], 0, high - sides.height);
		} else if (event.key === "Enter") {
			const { cell } = at;
			end();
			keep(cell, sides);
		} else if (event.key === "Escape") {
			const { cell } = at;
			end();
			cell.focus();
		} else return;
		event.preventDefault();
		event.stopPropagation();
		put();
	}

	function put() {
		if (!at) return;
		const { cell, index, sides } = at;
		const { zooms, cameras } = store.get();
		const [left, top, width, height] = Object.values(sides).map(Math.round);
		const words = `${cameras[index].name}: left ${left}, top ${top}, ${width} by ${height} px`;
		frame.ariaLabel = `Box in ${words}. Arrows move it, with Ctrl they size it, Enter keeps it.`;
		tell(words); // which may take a line above the pictures, and move them
		const lens = lensOf(zooms[index], cell.clientWidth, cell.clientHeight);
		const scale = (cell.clientWidth * lens.k) / cameras[index].width;
		Object.assign(frame.style, {
			left: `${mosaic.offsetLeft + cell.offsetLeft + sides.left * scale - lens.left}px`,
			top: `${mosaic.offsetTop + cell.offsetTop + sides.top * scale - lens.top}px`,
			width: `${sides.width * scale}px`,
			height: `${sides.height * scale}px`,
		});
	}
	store.on(["zooms", "large", "layout"], () => requestAnimationFrame(put));
	new ResizeObserver(put).observe(mosaic);
	store.on(["sequence"], end);
	return { begin, end };
}
