/** The room from above: the box around it, whose faces are dragged or moved by arrows. */
import { all, one, write } from "../elements/dom.js";

/**
 * @param {any} svg  as the server draws it, in metres
 * @param {number[][]} room  lowest and highest corner
 * @param {(room: any) => void} put  the corners, when they are let go
 */
export function mountPlan(svg, room, put) {
	const [left, bottom, high] = JSON.parse(svg.dataset.plan);
	const at = (/** @type {number} */ x, /** @type {number} */ y) => [x - left, high - (y - bottom)];
	/** @type {number[] | null} */
	let held = null;

	function place() {
		const [[x, v], [u, y]] = [at(room[0][0], room[0][1]), at(room[1][0], room[1][1])];
		const [width, height] = [u - x, v - y];
		for (const [name, value] of Object.entries({ x, y, width, height }))
			one(".box", svg).setAttribute(name, String(value));
		for (const grip of all(".grip", svg)) {
			const [axis, end] = (grip.dataset.face ?? "").split(" ").map(Number);
			const to = axis ? [x + width / 2, end ? y : v] : [end ? u : x, y + height / 2];
			grip.setAttribute("transform", `translate(${to})`);
		}
		all(".length", svg).forEach((text, axis) => {
			write(text, `${(room[1][axis] - room[0][axis]).toFixed(2)} m`);
			const to = axis ? [u - width * 0.16, y + height / 2] : [x + width / 2, y + height * 0.1];
			text.setAttribute("transform", `translate(${to})`);
		});
	}

	/** @param {number[]} face  axis and end @param {number} to */
	function move([axis, end], to) {
		const rounded = Math.round(to * 20) / 20;
		if (end ? rounded > room[0][axis] : rounded < room[1][axis]) room[end][axis] = rounded;
		place();
	}
	svg.onpointerdown = (/** @type {any} */ { target, pointerId }) => {
		if (!target.dataset.face) return;
		held = target.dataset.face.split(" ").map(Number);
		svg.setPointerCapture(pointerId);
		svg.dataset.held = "";
	};
	svg.onpointermove = (/** @type {PointerEvent} */ { clientX, clientY }) => {
		if (!held) return;
		const { x, y } = new DOMPoint(clientX, clientY).matrixTransform(svg.getScreenCTM().inverse());
		move(held, [x + left, bottom + high - y][held[0]]);
	};
	svg.onpointerup = svg.onpointercancel = () => {
		delete svg.dataset.held;
		if (held) put(room);
		held = null;
	};
	svg.onkeydown = (/** @type {KeyboardEvent} */ event) => {
		const by = { ArrowLeft: -0.05, ArrowRight: 0.05, ArrowDown: -0.05, ArrowUp: 0.05 }[event.key];
		if (!by) return;
		event.preventDefault();
		svg.dataset.held = "";
		const [axis, end] = [/Left|Right/.test(event.key) ? 0 : 1, event.shiftKey ? 1 : 0];
		move([axis, end], room[end][axis] + by);
	};
	svg.onkeyup = (/** @type {KeyboardEvent} */ { key }) => {
		if (!key.startsWith("Arrow")) return;
		delete svg.dataset.held;
		put(room);
	};
	// The key may be let go elsewhere.
	svg.onblur = () => delete svg.dataset.held;
	place();
}
