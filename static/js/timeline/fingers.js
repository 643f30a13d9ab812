/** Two fingers on the timeline: apart or together for fewer or more steps, both aside to move. */
import { panned, zoomed } from "../play/clock.js";

/** Fingers nearer than this are one thick one, CSS pixels. */
const NEAR = 20;

/** @param {HTMLElement} plot @param {Store<PageState>} store */
export function mountFingers(plot, store) {
	/** Where each is, from the plot's left edge. @type {Map<number, number>} */
	const fingers = new Map();
	const place = (/** @type {PointerEvent} */ event) =>
		event.clientX - plot.getBoundingClientRect().left;

	plot.addEventListener(
		"pointerdown",
		(event) => {
			if (event.pointerType !== "touch") return;
			fingers.set(event.pointerId, place(event));
			// A second one does not seek.
			if (fingers.size > 1) event.stopImmediatePropagation();
		},
		true,
	);
	plot.addEventListener(
		"pointermove",
		(event) => {
			const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
			const before = fingers.get(event.pointerId);
			if (before === undefined || other === undefined) return;
			event.stopImmediatePropagation();
			const now = place(event);
			fingers.set(event.pointerId, now);
			const { span, frames } = store.get();
			const [first, last] = span ?? [0, Math.max(1, frames - 1)];
			const far = (/** @type {number} */ at) => Math.max(NEAR, Math.abs(at - other));
			const middle = (now + other) / 2;
			const view = zoomed(
				{ first, last, width: plot.clientWidth },
				far(before) / far(now),
				middle,
				frames,
			);
			const aside = (middle - (before + other) / 2) / plot.clientWidth;
			const seen = panned(view, -aside * (view.last - view.first), frames);
			store.set({ span: [seen.first, seen.last] });
		},
		true,
	);
	for (const kind of /** @type {const} */ (["pointerup", "pointercancel"]))
		plot.addEventListener(kind, ({ pointerId }) => fingers.delete(pointerId));
}
