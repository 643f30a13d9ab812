/**
 * How often another document of this window draws: viser goes on drawing for a while after each
 * change, and where there is no graphics card each of its frames is one that pictures and overlays
 * have to wait for.
 */

/** Who turns or moves the 3D view wants every frame, for so long after, milliseconds. */
const TOUCHED = 400;

/**
 * Have a window's animation frames come no earlier than they may.
 * @param {Window} view
 * @param {(last: number, cost: number) => number} after  when, from when the last one was (the page's
 * clock) and how long it was until the browser was ready for another
 */
export function pace(view, after) {
	const ask = view.requestAnimationFrame.bind(view);
	const cancel = view.cancelAnimationFrame.bind(view);
	/** Those that wait, by a number of ours. @type {Map<number, Timer>} */
	const waiting = new Map();
	/** What the browser calls those that have waited. @type {Map<number, number>} */
	const asked = new Map();
	let [last, cost, touched, counted] = [0, 0, -Infinity, 2 ** 31];

	for (const name of ["pointerdown", "pointermove", "wheel"])
		view.addEventListener(
			name,
			(event) => {
				if (name !== "pointermove" || /** @type {PointerEvent} */ (event).buttons)
					touched = performance.now();
			},
			{ capture: true, passive: true },
		);
	view.requestAnimationFrame = (act) => {
		const now = performance.now();
		const rest = now - touched < TOUCHED ? 0 : after(last, cost) - now;
		if (rest <= 0) return ask(drawn(act));
		const own = (counted += 1);
		const then = () => {
			waiting.delete(own);
			const known = ask((time) => (asked.delete(own), drawn(act)(time)));
			asked.set(own, known);
		};
		waiting.set(own, setTimeout(then, rest));
		return own;
	};
	view.cancelAnimationFrame = (number) => {
		clearTimeout(waiting.get(number));
		waiting.delete(number);
		cancel(asked.get(number) ?? number);
		asked.delete(number);
	};
	/** @param {FrameRequestCallback} act @returns {FrameRequestCallback} */
	const drawn = (act) => (time) => {
		const begun = (last = performance.now());
		act(time);
		// What was told to the graphics card is still to be drawn.
		ask(() => (cost = performance.now() - begun));
	};
}
