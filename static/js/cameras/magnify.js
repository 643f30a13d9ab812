/**
 * Looking closer at a picture: wheel or two fingers magnify at the pointer, a drag moves what is
 * magnified, a double click goes in and out.
 */
import { lensOf } from "../draw/picture.js";

const MOST = 24;
/** What a double click magnifies by. */
const CLOSER = 3;
/** A press that moves less than this is a click, CSS pixels. */
const STILL = 4;

/**
 * The magnification after a factor at a point that keeps its place.
 * @param {Magnified | undefined} zoom
 * @param {number} factor
 * @param {{x: number, y: number, width: number, height: number}} spot  in its cell, CSS pixels
 * @returns {Magnified | undefined} undefined: the whole picture
 */
export function magnified(zoom, factor, { x, y, width, height }) {
	const { k, left, top } = lensOf(zoom, width, height);
	const next = Math.min(MOST, k * factor);
	if (next < 1.02) return undefined;
	const centre = (
		/** @type {number} */ at,
		/** @type {number} */ gone,
		/** @type {number} */ side,
	) => (((at + gone) / k) * next - at + side / 2) / (next * side);
	return [next, centre(x, left, width), centre(y, top, height)];
}

/** @param {HTMLElement} body  the pictures @param {Store<PageState>} store */
export function mountMagnifier(body, store) {
	/** @type {Map<number, {x: number, y: number}>} */
	const fingers = new Map();
	let travelled = 0;

	/** @param {MouseEvent} event */
	function spotOf({ target, clientX, clientY }) {
		const cam = /** @type {Element} */ (target).closest(".cam");
		if (!cam) return null;
		const { left, top, width, height } = cam.getBoundingClientRect();
		const index = [...body.children].indexOf(cam);
		return { cam, index, x: clientX - left, y: clientY - top, width, height };
	}
	/** @param {number} index @param {Magnified | undefined} zoom */
	function put(index, zoom) {
		const zooms = { ...store.get().zooms };
		if (zoom) zooms[index] = zoom;
		else delete zooms[index];
		store.set({ zooms });
	}

	body.addEventListener(
		"wheel",
		(event) => {
			const spot = spotOf(event);
			if (!spot) return;
			event.preventDefault();
			put(
				spot.index,
				magnified(store.get().zooms[spot.index], Math.exp(-event.deltaY * 0.002), spot),
			);
		},
		{ passive: false },
	);
	body.addEventListener("dblclick", (event) => {
		const spot = spotOf(event);
		if (!spot || event.shiftKey) return;
		const zoom = store.get().zooms[spot.index];
		put(spot.index, zoom ? undefined : magnified(zoom, CLOSER, spot));
	});
	body.addEventListener("pointerdown", (event) => {
		if (event.button !== 0 || !spotOf(event)) return;
		if (!fingers.size) travelled = 0;
		fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
	});
	body.addEventListener("pointermove", (event) => {
		// It may have been let go outside, before anything was captured.
		if (!event.buttons) fingers.delete(event.pointerId);
		const before = fingers.get(event.pointerId);
		const spot = spotOf(event);
		if (!before || !spot) return;
		const now = { x: event.clientX, y: event.clientY };
		const [dx, dy] = [now.x - before.x, now.y - before.y];
		travelled += Math.hypot(dx, dy);
		fingers.set(event.pointerId, now);
		if (travelled < STILL) return;
		// From now on it is no click, and it goes on where it leaves the picture.
		spot.cam.setPointerCapture(event.pointerId);
		const zoom = store.get().zooms[spot.index];
		const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
		if (other) {
			const far = (/** @type {{x: number, y: number}} */ at) =>
				Math.max(20, Math.hypot(at.x - other.x, at.y - other.y));
			put(spot.index, magnified(zoom, far(now) / far(before), spot));
		} else if (zoom) {
			const [k, x, y] = zoom;
			put(spot.index, [k, x - dx / (k * spot.width), y - dy / (k * spot.height)]);
		}
	});
	for (const kind of /** @type {const} */ (["pointerup", "pointercancel"]))
		body.addEventListener(kind, ({ pointerId }) => fingers.delete(pointerId));
	body.addEventListener(
		"click",
		(event) => {
			if (travelled >= STILL) event.stopPropagation();
			travelled = 0;
		},
		true,
	);
}
