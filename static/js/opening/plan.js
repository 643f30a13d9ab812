/** The room of an import from above: the box around it, whose faces are dragged or moved by arrows. */
import { all, one, svg, write } from "../elements/dom.js";

/** About how many pixels the plan has at most; lengths of its signs are by these. */
const SIZE = [330, 320];

/** How long a camera is in the plan: metres, and at least so many pixels. */
const CAMERA = [0.7, 18];

/** Lengths of the bar that shows the scale, metres, and at least so many pixels. */
const BARS = [1, 2, 5, 10, 20, 50];
const SHORTEST_BAR = 28;

/** Of a length or a place in the plan: to the millimetre. @param {number} value */
const mm = (value) => value.toFixed(3);

/**
 * In metres, y up.
 * @param {Server.ImportInfo} info @param {string} words  what it says
 * @param {(room: Server.ImportWish["room"]) => void} moved  where its faces are when they are let go
 */
export function planPicture(info, words, moved) {
	const { plan, room, wish } = info;
	const named = { class: "plan", role: "img", "aria-label": words };
	if (!plan || !room) return svg("svg", named);
	const [wide, high] = [plan.width * plan.cell, plan.height * plan.cell];
	const pixel = Math.max(wide / SIZE[0], high / SIZE[1]);
	const at = (/** @type {number} */ x, /** @type {number} */ y) => [
		x - plan.x,
		high - (y - plan.y),
	];
	const length = Math.max(CAMERA[0], CAMERA[1] * pixel);
	const labels = plan.cameras.map(([x, y, way], k) => {
		const [u, v] = at(x, y);
		const name = info.cameras[k]?.name ?? "";
		const half = Math.min(4.5 * name.length * pixel, wide / 2);
		// Behind the camera; at an edge of the plan, where there is no room for that, beside it.
		const behind = v + (Math.sin(way) > 0 ? 14 : -5) * pixel;
		const base = Math.min(Math.max(behind, 14 * pixel), high - 6 * pixel);
		const side = u < wide / 2 ? 1 : -1;
		const middle = base === behind ? u : u + side * (half + length / 2);
		return {
			name,
			half,
			x: Math.min(Math.max(middle, half + 4 * pixel), wide - half - 4 * pixel),
			y: base,
		};
	});
	const signs = plan.cameras.map(([x, y, way]) => {
		const [u, v] = at(x, y);
		const half = length / 2;
		return { half, x: u + half * Math.cos(way), y: v - half * Math.sin(way) };
	});
	const bar = BARS.find((metres) => metres >= SHORTEST_BAR * pixel) ?? BARS[5];
	const [scaleX, scaleY] = freePlace([...labels, ...signs], wide, high, pixel, bar);
	const drawing = svg(
		"svg",
		{
			...named,
			tabindex: 0,
			viewBox: `0 0 ${mm(wide)} ${mm(high)}`,
			"--pixel": `${pixel.toFixed(5)}px`,
			"--shape": (wide / high).toFixed(3),
		},
		svg("rect.ground", { width: mm(wide), height: mm(high) }),
		tint(plan),
		svg("path.feet", { d: plan.feet.map(([x, y]) => `M${at(x, y).map(mm).join(" ")}h0`).join("") }),
		plan.entrances.map(([x, y, width, depth]) => {
			const [cx, cy] = at(x, y).map(mm);
			// Hollow while it is only suggested.
			return svg("ellipse", {
				class: wish.entrances.length ? "entrance" : "entrance suggested",
				cx,
				cy,
				rx: mm(Math.max(width, 4 * pixel)),
				ry: mm(Math.max(depth, 4 * pixel)),
			});
		}),
		plan.cameras.flatMap(([x, y, way, half], k) => {
			const [u, v] = at(x, y);
			const ends = [-half, half].map(
				(turn) =>
					`L${mm(u + length * Math.cos(way + turn))} ${mm(v - length * Math.sin(way + turn))}`,
			);
			const { name, x: left, y: base } = labels[k];
			return [
				svg("path.camera", { d: `M${mm(u)} ${mm(v)}${ends.join("")}z` }),
				svg("text", { x: mm(left), y: mm(base) }, name),
			];
		}),
		svg("rect.box"),
		[0, 1].flatMap((axis) =>
			[0, 1].map((end) => {
				const [x, y] = axis ? [13, 4] : [4, 13];
				return svg("rect.grip", {
					"data-face": `${axis} ${end}`,
					x: -x * pixel,
					y: -y * pixel,
					width: 2 * x * pixel,
					height: 2 * y * pixel,
					rx: 3 * pixel,
				});
			}),
		),
		svg("text.length", { dy: 22 * pixel }),
		svg("text.length", { dx: -36 * pixel }),
		svg("path.scale", { d: `M${mm(scaleX - bar / 2)} ${mm(scaleY)}h${bar}` }),
		svg("text", { x: mm(scaleX), y: mm(scaleY - 4 * pixel) }, `${bar} m`),
	);
	mountFaces(drawing, room, at, moved);
	return drawing;
}

/**
 * The middle of the bar that shows the scale, along the lower or the upper edge of the plan where
 * nothing else is drawn, metres from its upper left; at the lower right where there is no such place.
 * @param {{x: number, y: number, half: number}[]} drawn  middles of names and cameras, and half their widths
 * @param {number} wide @param {number} high @param {number} pixel  of the plan, metres
 * @param {number} bar  its length
 */
export function freePlace(drawn, wide, high, pixel, bar) {
	const [left, right] = [bar / 2 + 8 * pixel, wide - bar / 2 - 8 * pixel];
	const places = [high - 10 * pixel, 22 * pixel].flatMap((y) =>
		[1, 0, 0.75, 0.25, 0.5].map((part) => [left + part * (right - left), y]),
	);
	const isFree = (/** @type {number[]} */ [x, y]) =>
		drawn.every(
			(one) =>
				Math.abs(one.x - x) > one.half + bar / 2 ||
				Math.abs(one.y - y) > 20 * pixel + Math.min(one.half, 12 * pixel),
		);
	return places.find(isFree) ?? places[0];
}

/** So much of a cell's height, for rows that only touch leave a line between them. */
const OVERLAP = 1.05;

/** The floor by how many cameras see it: cells of a row that are alike in one piece. @param {Server.ImportedPlan} plan */
function tint({ seen, width, height, cell }) {
	const pieces = ["", "", "", "", ""];
	for (let row = 0; row < height; row += 1) {
		const count = (/** @type {number} */ column) => Math.min(4, seen[row * width + column]);
		const top = mm((height - 1 - row) * cell);
		for (let column = 0, end = 0; column < width; column = end) {
			while (end < width && count(end) === count(column)) end += 1;
			const length = (end - column) * cell;
			pieces[count(column)] +=
				`M${mm(column * cell)} ${top}h${mm(length)}v${mm(cell * OVERLAP)}h${mm(-length)}z`;
		}
	}
	return pieces.map((d, k) => k > 0 && d && svg("path", { class: `floor seen-${k}`, d }));
}

/**
 * @param {SVGSVGElement} drawing
 * @param {[number, number, number][]} room  lowest and highest corner
 * @param {(x: number, y: number) => number[]} at  where a place is drawn
 * @param {(room: any) => void} moved  the corners, when they are let go
 */
function mountFaces(drawing, room, at, moved) {
	/** As it is dragged. */
	let now = structuredClone(room);
	/** @type {number[] | null} */
	let held = null;

	function place() {
		const [[x, v], [u, y]] = [at(now[0][0], now[0][1]), at(now[1][0], now[1][1])];
		const [width, height] = [u - x, v - y];
		for (const [name, value] of Object.entries({ x, y, width, height }))
			one(".box", drawing).setAttribute(name, String(value));
		for (const grip of all(".grip", drawing)) {
			const [axis, end] = (grip.dataset.face ?? "").split(" ").map(Number);
			const to = axis ? [x + width / 2, end ? y : v] : [end ? u : x, y + height / 2];
			grip.setAttribute("transform", `translate(${to})`);
		}
		all(".length", drawing).forEach((text, axis) => {
			write(text, `${(now[1][axis] - now[0][axis]).toFixed(2)} m`);
			const to = axis ? [u, y + height / 2] : [x + width / 2, y];
			text.setAttribute("transform", `translate(${to})`);
		});
	}

	/** What was let go before and not taken is forgotten. */
	function hold() {
		if (!("held" in drawing.dataset)) now = structuredClone(room);
		drawing.dataset.held = "";
	}

	/** @param {number[]} face  axis and end @param {number} to */
	function move([axis, end], to) {
		const rounded = Math.round(to * 20) / 20;
		if (end ? rounded > now[0][axis] : rounded < now[1][axis]) now[end][axis] = rounded;
		place();
	}
	drawing.onpointerdown = ({ target, pointerId }) => {
		const { face } = /** @type {SVGElement} */ (target).dataset;
		if (!face) return;
		held = face.split(" ").map(Number);
		drawing.setPointerCapture(pointerId);
		hold();
	};
	drawing.onpointermove = ({ clientX, clientY }) => {
		const matrix = held && drawing.getScreenCTM()?.inverse();
		if (!held || !matrix) return;
		const { x, y } = new DOMPoint(clientX, clientY).matrixTransform(matrix);
		const [left, top] = at(0, 0);
		move(held, [x - left, top - y][held[0]]);
	};
	drawing.onpointerup = drawing.onpointercancel = () => {
		delete drawing.dataset.held;
		if (held) moved(now);
		held = null;
	};
	drawing.onkeydown = (event) => {
		const by = { ArrowLeft: -0.05, ArrowRight: 0.05, ArrowDown: -0.05, ArrowUp: 0.05 }[event.key];
		if (!by) return;
		event.preventDefault();
		hold();
		const [axis, end] = [/Left|Right/.test(event.key) ? 0 : 1, event.shiftKey ? 1 : 0];
		move([axis, end], now[end][axis] + by);
	};
	drawing.onkeyup = ({ key }) => {
		if (!key.startsWith("Arrow")) return;
		delete drawing.dataset.held;
		moved(now);
	};
	// The key may be let go elsewhere.
	drawing.onblur = () => delete drawing.dataset.held;
	place();
}
