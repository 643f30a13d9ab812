/** The room from above: who sees the floor where, how the cameras look, and the box with its grips. */
import { faded, palette } from "../draw/colours.js";
import { prepare, stroke, trace } from "../draw/canvas.js";

/** Opacity of the floor by how many cameras see it. */
const TINTS = [0, 0.1, 0.2, 0.33, 0.48];
const LENGTH = 0.7;
const NEAR = 12;

/** @typedef {{axis: 0 | 1, end: 0 | 1}} Face */

/** @type {Face[]} */
const FACES = [
	{ axis: 0, end: 0 },
	{ axis: 0, end: 1 },
	{ axis: 1, end: 0 },
	{ axis: 1, end: 1 },
];

/**
 * @param {HTMLCanvasElement} canvas
 * @param {Server.ImportInfo} info
 * @param {number[][]} room  lowest and highest corner
 * @returns {{face: (x: number, y: number) => Face | null, metres: (x: number, y: number) => number[]}}
 */
function drawPlan(canvas, info, room) {
	const [width, height] = [canvas.clientWidth, canvas.clientHeight];
	const g = prepare(canvas, width, height);
	const { plan, cameras } = info;
	if (!plan) return { face: () => null, metres: () => [0, 0] };
	const colours = palette();
	const [ink, accent, card] = ["ink-1", "accent", "card"].map(colours.get);
	const [wide, high] = [plan.width * plan.cell, plan.height * plan.cell];
	const k = Math.min((width - 8) / wide, (height - 8) / high);
	const [left, bottom] = [(width - k * wide) / 2, (height + k * high) / 2];
	const at = (/** @type {number} */ x, /** @type {number} */ y) => [
		left + (x - plan.x) * k,
		bottom - (y - plan.y) * k,
	];
	plan.seen.forEach((count, place) => {
		if (!count) return;
		const [i, j] = [place % plan.width, Math.floor(place / plan.width)];
		// Whole pixels, so that neighbours neither overlap nor leave a line between them.
		const [x, to] = [i, i + 1].map((cells) => Math.round(left + cells * plan.cell * k));
		const [low, y] = [j, j + 1].map((cells) => Math.round(bottom - cells * plan.cell * k));
		g.fillStyle = faded(accent, TINTS[Math.min(count, 4)]);
		g.fillRect(x, y, to - x, low - y);
	});
	g.fillStyle = faded(ink, 0.6);
	for (const [x, y] of plan.feet) {
		const [u, v] = at(x, y);
		g.fillRect(u - 1, v - 1, 2, 2);
	}
	g.font = `600 11px ${colours.font}`;
	g.textAlign = "center";
	g.textBaseline = "bottom";
	plan.cameras.forEach(([x, y, way, half], index) => {
		const ends = [-half, half].map((turn) =>
			at(x + LENGTH * Math.cos(way + turn), y + LENGTH * Math.sin(way + turn)),
		);
		trace(g, [at(x, y), ...ends, at(x, y)]);
		g.fillStyle = faded(card, 0.8);
		g.fill();
		stroke(g, ink, 1.25);
		const [u, v] = at(x, y);
		g.fillStyle = ink;
		const name = cameras[index]?.name ?? "";
		const side = g.measureText(name).width / 2 + 4;
		g.fillText(name, Math.max(side, Math.min(width - side, u)), Math.max(14, v - 4));
	});
	const [a, b] = [at(room[0][0], room[1][1]), at(room[1][0], room[0][1])];
	g.fillStyle = faded(accent, 0.06);
	g.fillRect(a[0], a[1], b[0] - a[0], b[1] - a[1]);
	trace(g, [a, [b[0], a[1]], b, [a[0], b[1]], a]);
	stroke(g, accent, 1.5);
	/** The middle of each face. */
	const grips = FACES.map(({ axis, end }) =>
		axis ? [(a[0] + b[0]) / 2, end ? a[1] : b[1]] : [end ? b[0] : a[0], (a[1] + b[1]) / 2],
	);
	grips.forEach(([x, y], index) => {
		const [w, h] = FACES[index].axis ? [26, 8] : [8, 26];
		g.beginPath();
		g.roundRect(x - w / 2, y - h / 2, w, h, 3);
		g.fillStyle = card;
		g.fill();
		stroke(g, accent, 1.5);
	});
	const label = (/** @type {string} */ text, /** @type {number} */ x, /** @type {number} */ y) => {
		const side = g.measureText(text).width + 10;
		g.fillStyle = card;
		g.fillRect(x - side / 2, y - 9, side, 18);
		g.fillStyle = ink;
		g.fillText(text, x, y + 6);
	};
	const metres = (/** @type {number} */ axis) => `${(room[1][axis] - room[0][axis]).toFixed(2)} m`;
	label(metres(0), (a[0] + b[0]) / 2, a[1] + 20);
	label(metres(1), b[0] - 36, (a[1] + b[1]) / 2);
	trace(g, [
		[width - 12 - k, height - 10],
		[width - 12, height - 10],
	]);
	stroke(g, ink, 1.5);
	g.textAlign = "right";
	g.fillText("1 m", width - 12, height - 14);
	return {
		face(x, y) {
			const away = grips.map(([u, v]) => Math.hypot(u - x, v - y));
			const best = away.indexOf(Math.min(...away));
			return away[best] < NEAR ? FACES[best] : null;
		},
		metres: (x, y) => [plan.x + (x - left) / k, plan.y + (bottom - y) / k],
	};
}

/**
 * A plan whose faces can be dragged, or moved by arrows.
 * @param {HTMLCanvasElement} canvas
 * @param {Server.ImportInfo} info
 * @param {(room: any) => void} put  the corners, when they are let go
 */
export function mountPlan(canvas, info, put) {
	if (!info.room) return;
	const room = info.room.map((corner) => [...corner]);
	let drawn = drawPlan(canvas, info, room);
	/** @type {Face | null} */
	let held = null;
	/** @param {Face} face @param {number} to */
	function move({ axis, end }, to) {
		const rounded = Math.round(to * 20) / 20;
		if (end ? rounded > room[0][axis] : rounded < room[1][axis]) room[end][axis] = rounded;
		drawn = drawPlan(canvas, info, room);
	}
	canvas.onpointerdown = ({ offsetX, offsetY, pointerId }) => {
		held = drawn.face(offsetX, offsetY);
		if (!held) return;
		canvas.setPointerCapture(pointerId);
		canvas.dataset.held = "";
	};
	canvas.onpointermove = ({ offsetX, offsetY }) => {
		canvas.style.cursor = (held ?? drawn.face(offsetX, offsetY)) ? "grab" : "";
		if (held) move(held, drawn.metres(offsetX, offsetY)[held.axis]);
	};
	canvas.onpointerup = () => {
		delete canvas.dataset.held;
		if (held) put(room);
		held = null;
	};
	canvas.onkeydown = (event) => {
		const axis = /Left|Right/.test(event.key) ? 0 : 1;
		const by = { ArrowLeft: -0.05, ArrowRight: 0.05, ArrowDown: -0.05, ArrowUp: 0.05 }[event.key];
		if (!by) return;
		event.preventDefault();
		const end = event.shiftKey ? 1 : 0;
		move({ axis, end }, room[end][axis] + by);
	};
	canvas.onkeyup = ({ key }) => key.startsWith("Arrow") && put(room);
}

/**
 * How well a camera agrees with the others when it is shifted.
 * @param {HTMLCanvasElement} canvas
 * @param {Server.ImportedOffset | null} found
 * @param {number} late  frames, as it is wished
 */
export function drawCurve(canvas, found, late) {
	const [width, height] = [canvas.clientWidth, canvas.clientHeight];
	const g = prepare(canvas, width, height);
	const colours = palette();
	const [ink, quiet, line, warn] = ["ink-2", "ink-3", "line-2", "warn"].map(colours.get);
	const base = height - 12.5;
	trace(g, [
		[0, base],
		[width, base],
	]);
	stroke(g, line, 1);
	g.font = `10px ${colours.font}`;
	g.textAlign = "center";
	g.fillStyle = quiet;
	if (!found) {
		g.fillText("nothing to compare", width / 2, base - 6);
		return;
	}
	const reach = Math.max(30, Math.ceil(Math.abs(found.steps) + 5));
	const X = (/** @type {number} */ steps) => width / 2 + (steps / reach) * (width / 2 - 6);
	const near = found.offsets
		.map((offset, index) => [offset, found.agreement[index]])
		.filter(([offset, value]) => value !== null && Math.abs(offset ?? 0) <= reach);
	const values = near.map(([, value]) => value ?? 0);
	const [low, top] = [Math.min(...values), Math.max(...values)];
	const Y = (/** @type {number} */ value) =>
		base - 2 - ((value - low) / (top - low || 1)) * (base - 6);
	trace(
		g,
		near.map(([offset, value]) => [X(offset ?? 0), Y(value ?? 0)]),
	);
	stroke(g, found.sure ? warn : ink, 1.5);
	trace(g, [
		[Math.round(X(0)) + 0.5, 2],
		[Math.round(X(0)) + 0.5, base],
	]);
	stroke(g, quiet, 1);
	g.fillText(late.toFixed(0), X(0), height - 2);
	if (found.sure) {
		g.beginPath();
		g.arc(X(found.steps), Y(top), 3, 0, 7);
		g.fillStyle = warn;
		g.fill();
		g.fillText((late + found.steps).toFixed(0), X(found.steps), height - 2);
	}
	g.fillStyle = quiet;
	g.textAlign = "left";
	g.fillText((late - reach).toFixed(0), 0, height - 2);
	g.textAlign = "right";
	g.fillText((late + reach).toFixed(0), width, height - 2);
}
