/** The chart of the page: axes with round ticks, marks, a card at the pointer or by keys, a brush. */
import { claim, fill, h, show, svg } from "./dom.js";

/**
 * @typedef {object} Axis
 * @property {number[]} ends  the least and the largest value
 * @property {boolean} [log]
 * @property {(readonly [number, Child | Child[]])[]} [ticks]  values with their words; round ones
 * without
 * @property {string} [title]
 *
 * @typedef {object} Point
 * @property {number} x
 * @property {number} y
 * @property {number} [low]  where a bar begins, or the lower edge of a band at this x
 * @property {number} [key]  what is chosen by a click, and by which the point is known again
 * @property {string} [says]  the lines of its card; without them it has none
 * @property {string} [note]  stands beside it
 * @property {number} [strength]  0 … 1, how visible it is
 *
 * @typedef {object} Mark
 * @property {"dots" | "line" | "steps" | "band" | "bars"} kind  steps hold a value until the next
 * x; a band lies between `low` and `y`, a bar goes along x from `low`
 * @property {Point[]} points
 * @property {string} colour  a token of the page
 * @property {number} [size]  CSS pixels: radius of a dot, width of a line, height of a bar
 * @property {"diamond" | "ring"} [shape]  of dots
 * @property {boolean} [rises]  steps go to the next value at once and hold it
 *
 * @typedef {object} Figure
 * @property {Axis} x
 * @property {Axis} y
 * @property {Mark[]} marks  the last on top
 * @property {number[]} margin  CSS pixels left, above, right and below, for ticks and titles
 * @property {string} [aside]  small, in the lower right corner
 */

/** CSS pixels between two ticks at least. */
const [ACROSS, UP] = [40, 28];
/** CSS pixels from a dot to its note, and those of a letter across and of a line. */
const [AWAY, LETTER, LINE] = [8, 6.5, 16];

/**
 * Round values between two ends, with as many digits as tell them apart.
 * @param {number[]} ends
 * @param {number} most  of them
 * @returns {[number, string][]}
 */
export function roundTicks([low, high], most) {
	const least = (high - low) / Math.max(1, most);
	if (!(least > 0 && least < Infinity)) return [];
	const power = 10 ** Math.floor(Math.log10(least));
	const apart = power * ([1, 2, 5].find((k) => k * power >= least) ?? 10);
	const digits = Math.max(0, -Math.floor(Math.log10(apart)));
	const tiny = Math.max(-low, high) < 1e-3;
	// an end that is a tick is one in spite of the last bit of a division
	const [first, last] = [Math.ceil(low / apart - 1e-9), Math.floor(high / apart + 1e-9)];
	return Array.from({ length: last - first + 1 }, (_, k) => {
		const value = (first + k) * apart;
		const text = tiny ? show(Number(value.toPrecision(3))) : value.toFixed(digits);
		return [value, Number(text) < 0 ? text.replace("-", "−") : text.replace("-", "")];
	});
}

/** The ends of a logarithmic axis and the power of ten between. @param {number[]} ends */
export function logTicks([low, high]) {
	const ten = 10 ** Math.round(Math.log10(low * high) / 2);
	const apart = (high / low) ** 0.25;
	const values = ten > low * apart && ten < high / apart ? [low, ten, high] : [low, high];
	return values.map((value) => /** @type {const} */ ([value, show(Number(value.toPrecision(3)))]));
}

/**
 * From values to CSS pixels and back.
 * @param {Axis} axis
 * @param {number} from  pixel of the least value
 * @param {number} to  of the largest
 */
export function scaleOf({ ends, log }, from, to) {
	const bend = log ? Math.log : Number;
	const [low, high] = ends.map(bend);
	const slope = (to - from) / (high - low || 1);
	return {
		at: (/** @type {number} */ value) => from + (bend(value) - low) * slope,
		value: (/** @type {number} */ place) => {
			const bent = Math.max(low, Math.min(high, low + (place - from) / slope));
			return log ? Math.exp(bent) : bent;
		},
	};
}

/** A point on the page. @typedef {{x: number, y: number, by: string, point: Point}} Target */

/**
 * A figure of a certain size, drawn once.
 * @param {Figure} figure
 * @param {number} width  CSS pixels
 * @param {number} height
 */
export function plot({ x, y, marks, margin, aside }, width, height) {
	const [left, top, right, bottom] = margin;
	const across = scaleOf(x, left, width - right);
	const up = scaleOf(y, height - bottom, top);
	const place = (/** @type {Point} */ point) => [across.at(point.x), up.at(point.y)];
	const inside = (/** @type {number[]} */ [a, b]) =>
		a > left - 1 && a < width - right + 1 && b > top - 1 && b < height - bottom + 1;
	/** @type {Map<unknown, Target>} */
	const targets = new Map();
	/** What no note may lie over: dots that have one, and notes. */
	const placed = marks
		.flatMap(({ points }) => points.filter((point) => point.note).map(place))
		.map(([a, b]) => ({ left: a - AWAY + 1, top: b - LINE / 2, width: 2 * AWAY - 2 }));
	/** @type {Element[]} */
	const words = [];
	/** @param {Child | Child[]} text @param {string} kind @param {number} a @param {number} b */
	const word = (text, kind, a, b) =>
		words.push(h("span", { class: kind, "--x": `${a}px`, "--y": `${b}px` }, text));

	/** Beside its dot, where it lies over no other. @param {string} text @param {number} a @param {number} b */
	function note(text, a, b) {
		const long = text.length * LETTER;
		const free = [b - LINE - 2, b + 2]
			.flatMap((above) => [a + AWAY, a - AWAY - long].map((beside) => [beside, above]))
			.find(
				([beside, above]) =>
					beside >= left &&
					beside + long <= width &&
					above >= 0 &&
					placed.every(
						(other) =>
							beside > other.left + other.width ||
							beside + long < other.left ||
							Math.abs(above - other.top) >= LINE,
					),
			);
		if (!free) return;
		placed.push({ left: free[0], top: free[1], width: long });
		word(text, free[0] < a ? "noted before" : "noted", free[0] < a ? a - AWAY : free[0], free[1]);
	}

	/** @type {Record<Mark["kind"], (mark: Mark) => Element[]>} */
	const draw = {
		dots: ({ points, size = 3, shape }) =>
			points
				.filter((point) => inside(place(point)))
				.map((point) => {
					const [a, b] = place(point);
					if (point.note) note(point.note, a, b);
					return shape === "diamond"
						? svg("path", {
								d: `M${a} ${b - size}l${size} ${size}l${-size} ${size}l${-size} ${-size}z`,
							})
						: svg("circle", { cx: a, cy: b, r: size, opacity: point.strength });
				}),
		line: ({ points }) => [svg("polyline", { points: points.map(place).join(" ") })],
		steps: ({ points, rises }) => {
			const corners = points.map(place).flatMap(([a, b], k, all) => {
				const [c, d] = all[k + 1] ?? [a, b];
				return [[a, b], rises ? [a, d] : [c, b]];
			});
			return [svg("polyline", { points: corners.join(" ") })];
		},
		band: ({ points }) => {
			const lower = points.map((point) => [across.at(point.x), up.at(point.low ?? y.ends[0])]);
			return [svg("polygon", { points: [...points.map(place), ...lower.reverse()].join(" ") })];
		},
		bars: ({ points, size = 10 }) =>
			points.map((point) => {
				const [a, b] = place(point);
				const from = across.at(point.low ?? x.ends[0]);
				return svg("rect", {
					x: from,
					y: b - size / 2,
					width: Math.max(0, a - from),
					height: size,
				});
			}),
	};
	const drawn = marks.map((mark) => {
		const { kind, colour, shape, size, points } = mark;
		for (const point of points) {
			const [a, b] = place(point);
			if (point.says && inside([a, b]))
				targets.set(point.key ?? point, { x: a, y: b, by: kind, point });
		}
		const lines = kind === "line" || kind === "steps";
		const style = { class: shape ?? (lines ? "line" : kind), "--c": `var(--${colour})` };
		return svg("g", { ...style, "stroke-width": lines && size }, draw[kind](mark));
	});
	const [level, upright] = [x, y].map((axis, k) => {
		const room = k ? height - top - bottom : width - left - right;
		if (axis.ticks) return axis.ticks;
		return axis.log ? logTicks(axis.ends) : roundTicks(axis.ends, room / (k ? UP : ACROSS));
	});
	for (const [value, text] of level) word(text, "tick across", across.at(value), height - bottom);
	for (const [value, text] of upright) word(text, "tick up", left, up.at(value));
	if (x.title) word(x.title, "title across", (left + width - right) / 2, height);
	if (y.title) word(y.title, "title up", 0, (top + height - bottom) / 2);
	if (aside) word(aside, "aside", width - right, height - bottom);
	const grid = [
		...level.map(([value]) => `M${across.at(value)} ${top}V${height - bottom}`),
		...upright.map(([value]) => `M${left} ${up.at(value)}H${width - right}`),
	];
	// What is larger than the axes is cut a pixel beyond them, where half of a line is; dots are whole.
	const [wide, tall] = [width - left - right, height - top - bottom];
	const box = {
		x: left - 1,
		y: top - 1,
		width: Math.max(0, wide + 2),
		height: Math.max(0, tall + 2),
	};
	const within = { ...box, viewBox: Object.values(box).join(" ") };
	const element = h(
		"div.figure",
		{ "--left": `${left}px`, "--room": `${tall}px` },
		svg(
			"svg",
			{ width, height, "aria-hidden": "true" },
			svg("path.grid", { d: grid.join("") }),
			marks.map(({ kind }, k) => (kind === "dots" ? drawn[k] : svg("svg", within, drawn[k]))),
		),
		words,
	);
	return { element, across, targets: [...targets.values()].sort((a, b) => a.x - b.x) };
}

/** CSS pixels from the pointer to what it means at most, and those that make a drag of a press. */
const [NEAR, DRAG] = [20, 4];

/**
 * What is drawn, and what can be done there.
 * @typedef {Figure & {
 *   label: string,
 *   choose?: (key: number) => void,
 *   brush?: ((low: number, high: number) => void) | null,
 * }} Live
 */

/**
 * A chart that follows the size of its place. The arrows left and right walk through its points,
 * Enter chooses one; with Shift they span a range along x, which Enter takes.
 */
export function chart() {
	/** @type {Live | null} */
	let figure = null;
	/** @type {ReturnType<typeof plot> | null} */
	let drawn = null;
	/** @type {Target | undefined} */
	let at;
	/** Where a range along x began, CSS pixels. @type {number | null} */
	let from = null;
	const stage = h("div");
	const card = h("div.says", { role: "status" });
	const ring = h("i.at", { hidden: true });
	const range = h("i.range", { hidden: true });
	const element = h(
		"div.chart",
		{
			role: "application",
			"aria-roledescription": "chart",
			tabindex: 0,
			onpointermove: (event) => {
				if (figure?.brush && from !== null && event.buttons) {
					mean(undefined);
					return span(placeOf(event)[0]);
				}
				mean(nearest(...placeOf(event)));
			},
			onpointerdown: (/** @type {PointerEvent} */ event) => {
				from = event.button ? null : placeOf(event)[0];
				if (figure?.brush) element.setPointerCapture(event.pointerId);
			},
			onpointerup: (/** @type {PointerEvent} */ event) => {
				const [x, y] = placeOf(event);
				if (from === null) return;
				if (figure?.brush && Math.abs(x - from) > DRAG) return take(x);
				from = null;
				mean(nearest(x, y));
				choose();
			},
			onpointercancel: () => span(null),
			onpointerleave: () => from === null && mean(undefined),
			onblur: () => (mean(undefined), span(null)),
			onkeydown: keyed,
		},
		stage,
		range,
		ring,
		card,
	);

	/** @param {PointerEvent} event @returns {[number, number]} */
	function placeOf({ clientX, clientY }) {
		const { left, top } = element.getBoundingClientRect();
		return [clientX - left, clientY - top];
	}

	/** @param {number} x @param {number} y */
	function nearest(x, y) {
		let [found, least] = [/** @type {Target | undefined} */ (undefined), NEAR];
		for (const target of drawn?.targets ?? []) {
			const { by } = target;
			const away = Math.hypot(
				by === "bars" ? 0 : target.x - x,
				by === "dots" || by === "bars" ? target.y - y : 0,
			);
			if (away <= least) [found, least] = [target, away];
		}
		return found;
	}

	/** Show what a point says. @param {Target | undefined} target */
	function mean(target) {
		if (target !== at) fill(card, target?.point.says);
		at = target;
		ring.hidden = !target;
		element.classList.toggle("chooses", Boolean(target && figure?.choose));
		if (!target) return;
		for (const part of [ring, card]) {
			part.style.setProperty("--x", `${target.x}px`);
			part.style.setProperty("--y", `${target.y}px`);
		}
		const { x, y } = target;
		const over = x + AWAY + card.offsetWidth > element.clientWidth;
		card.style.left = `${Math.max(0, over ? x - AWAY - card.offsetWidth : x + AWAY)}px`;
		card.style.top = `${y > card.offsetHeight + AWAY ? y - AWAY - card.offsetHeight : y + AWAY}px`;
	}

	/** Show a range from where it began. @param {number | null} to */
	function span(to) {
		if (to === null) from = null;
		range.hidden = from === null || to === null || !figure?.brush;
		if (from === null || to === null) return;
		range.style.setProperty("--x", `${Math.min(from, to)}px`);
		range.style.setProperty("--w", `${Math.abs(to - from)}px`);
	}

	/** Take the range. @param {number} to */
	function take(to) {
		const ends = [from ?? to, to].sort((a, b) => a - b).map((x) => drawn?.across.value(x) ?? 0);
		span(null);
		figure?.brush?.(ends[0], ends[1]);
	}

	function choose() {
		if (at?.point.key !== undefined) figure?.choose?.(at.point.key);
	}

	/** @param {KeyboardEvent} event */
	function keyed(event) {
		const { key, shiftKey } = event;
		const targets = drawn?.targets ?? [];
		const now = at ? targets.indexOf(at) : -1;
		const next = {
			ArrowRight: now + 1,
			ArrowLeft: now < 0 ? targets.length - 1 : now - 1,
			Home: 0,
			End: targets.length - 1,
		}[key];
		if (key === "Enter" || key === " ") {
			if (at && from !== null && figure?.brush) take(at.x);
			else choose();
		} else if (next !== undefined && targets.length && !event.ctrlKey && !event.altKey) {
			const target = targets[Math.max(0, Math.min(targets.length - 1, next))];
			from = shiftKey ? (from ?? at?.x ?? target.x) : null;
			mean(target);
			span(from === null ? null : target.x);
		} else return;
		claim(event);
	}

	function draw() {
		const { clientWidth: width, clientHeight: height } = element;
		if (!figure || !width || !height) return;
		const before = at?.point.key;
		drawn = plot(figure, width, height);
		fill(stage, drawn.element);
		if (at) mean(drawn.targets.find(({ point }) => point.key === before));
	}
	new ResizeObserver(draw).observe(element);

	return {
		element,
		/** @param {Live} next */
		show(next) {
			figure = next;
			element.ariaLabel = next.label;
			draw();
		},
		/** Nothing is drawn. @param {string} [words]  say why */
		clear(words) {
			figure = drawn = null;
			mean(undefined);
			fill(stage, words && h("p.blank", words));
		},
	};
}
