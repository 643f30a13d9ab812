/**
 * A finger or a pen that is held still asks for what the other button of a mouse asks for: not
 * every browser says so by itself.
 */

/** Held for so long, milliseconds, and moved by no more than so much, CSS pixels. */
const [HELD_MS, STILL] = [550, 8];

/** Letting go may be followed by a click; where it was not by then there is none, milliseconds. */
const AFTER_MS = 300;

/**
 * @param {HTMLElement} element
 * @param {(event: PointerEvent) => void} act  for where it was pressed; once when it was held long
 * enough, and once more when it is let go, since letting go closes what opened meanwhile
 */
export function whenHeld(element, act) {
	/** @type {PointerEvent | null} */
	let pressed = null;
	let held = false;
	/** @type {Timer} */
	let timer;
	const end = () => clearTimeout(timer);
	element.addEventListener(
		"pointerdown",
		(event) => {
			end();
			held = false;
			if (event.pointerType === "mouse" || !event.isPrimary || event.button !== 0) return;
			pressed = event;
			timer = setTimeout(() => {
				held = true;
				act(event);
			}, HELD_MS);
		},
		true,
	);
	element.addEventListener(
		"pointermove",
		({ clientX, clientY }) => {
			const far = pressed && Math.hypot(clientX - pressed.clientX, clientY - pressed.clientY);
			if (far && far > STILL) end();
		},
		true,
	);
	for (const kind of ["pointerup", "pointercancel", "contextmenu"])
		element.addEventListener(kind, end, true);
	element.addEventListener("pointerup", () => {
		const again = held ? pressed : null;
		if (again) timer = setTimeout(() => act(again), AFTER_MS);
	});
	// What ends it is no click, and closes what opened as one beside it would.
	element.addEventListener(
		"click",
		(event) => {
			const again = held ? pressed : null;
			if (!again) return;
			held = false;
			event.stopImmediatePropagation();
			event.preventDefault();
			end();
			setTimeout(() => act(again));
		},
		true,
	);
}
