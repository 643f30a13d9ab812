/** Plots over the steps, under the lanes and on the same axis. */
import { bucketOf, xOf } from "../play/clock.js";
import { faded } from "./colours.js";
import { stroke, trace } from "./canvas.js";

/**
 * A staircase: numbers of people hold for a whole step. Of many steps on one pixel the
 * lowest and the highest are drawn, so that a short change never disappears.
 * @param {Pen} pen
 * @param {Buckets} buckets
 * @param {{low: number[], high: number[]}} values
 * @param {number} top value at the upper edge
 * @param {string} colour @param {number} width @param {number[]} [dash]
 */
function drawStairs({ g, row, view }, buckets, { low, high }, top, colour, width, dash) {
	const { first, stride } = buckets;
	const from = Math.max(0, bucketOf(view.first, buckets));
	const to = Math.min(low.length - 1, bucketOf(view.last, buckets) + 1);
	const level = (/** @type {number} */ value) =>
		row.y + row.height - 4 - (Math.max(0, Math.min(value, top)) / top) * (row.height - 10);
	const x = (/** @type {number} */ k) =>
		Math.max(0, Math.min(view.width, xOf(first + k * stride, view)));
	const many = Math.max(1, Math.floor((view.last - view.first) / stride / Math.max(1, view.width)));
	/** @type {number[][]} */
	const points = [];
	for (let k = from; k <= to; k += many) {
		const [least, most] = [
			Math.min(...low.slice(k, k + many)),
			Math.max(...high.slice(k, k + many)),
		];
		points.push([x(k), level(least)]);
		if (most !== least) points.push([x(k), level(most)]);
		points.push([x(Math.min(k + many, to)), level(low[Math.min(k + many - 1, to)])]);
	}
	stroke(trace(g, points), colour, width, dash);
}

/** The edge above a strip and the ground it stands on. @param {Pen} pen */
export function drawGround({ g, row, view, ink }) {
	stroke(
		trace(g, [
			[0, row.y + 0.5],
			[view.width + 20, row.y + 0.5],
		]),
		ink.get("line-0"),
		1,
	);
	const base = row.y + row.height - 3.5;
	stroke(
		trace(g, [
			[0, base],
			[view.width, base],
		]),
		ink.get("p-grid"),
		1,
	);
}

/**
 * Number of people: truth broad and grey, the pinned run dashed, the reported targets thin over it.
 * @param {Pen} pen
 * @param {Server.Timeline} timeline
 */
export function drawCardinality(pen, timeline) {
	drawGround(pen);
	const { count, truth, pinned } = timeline;
	const top =
		1.1 *
		[count, truth, pinned?.count].reduce(
			(most, values) => (values?.high ?? []).reduce((a, b) => Math.max(a, b), most),
			2,
		);
	drawBand(pen, timeline, top);
	if (truth) drawStairs(pen, timeline, truth, top, pen.ink.get("p-truth"), 3);
	if (pinned) drawStairs(pen, timeline, pinned.count, top, pen.ink.get("ink-2"), 1, [4, 2]);
	drawStairs(pen, timeline, count, top, pen.ink.get("p-est"), 1.25);
}

/**
 * The expected number of people, a standard deviation up and down.
 * @param {Pen} pen @param {Server.Timeline} timeline @param {number} top
 */
function drawBand({ g, row, view, ink }, timeline, top) {
	const { cardinality, deviation } = timeline;
	const slope = (view.last - view.first) / view.width;
	const level = (/** @type {number} */ value) =>
		row.y + row.height - 4 - (Math.max(0, Math.min(value, top)) / top) * (row.height - 10);
	g.fillStyle = faded(ink.get("p-loc"), 0.4);
	for (let x = 0; x < view.width; x += 1) {
		const at = bucketOf(view.first + x * slope, timeline);
		const [mean, sigma] = [cardinality.mean[at], deviation.mean[at]];
		if (mean === undefined) continue;
		const [high, low] = [level(mean + sigma), level(mean - sigma)];
		if (sigma > 0) g.fillRect(x, high, 1, Math.max(1, low - high));
	}
}

/**
 * A distance between the sets of people and estimates, stacked: how much of it is place, how
 * much is number. Of the steps on one pixel the worst is drawn; what leaves the axis is capped.
 * @param {Pen} pen
 * @param {Server.EvaluationSeries} series
 * @param {Server.EvaluationSeries | null} reference
 * @param {"ospa" | "gospa"} name
 */
export function drawParts(pen, series, reference, name) {
	drawGround(pen);
	const { g, row, view, ink } = pen;
	const [total, share, top] = [
		series[name],
		series[`${name}_share`],
		Math.max(series.axes[name], reference?.axes[name] ?? 0),
	];
	const base = row.y + row.height - 4;
	const scale = (row.height - 10) / top;
	const slope = (view.last - view.first) / view.width;
	/** @type {[string, number, number, number][]} */
	const bars = [];
	for (let x = 0; x < view.width; x += 1) {
		let at = bucketOf(view.first + x * slope, series);
		if (at >= total.length) break;
		if (at < 0) continue;
		const next = Math.min(total.length, bucketOf(view.first + (x + 1) * slope, series));
		for (let k = at + 1; k < next; k += 1) if (total[k] > total[at]) at = k;
		const height = Math.min(total[at], top) * scale;
		const low = Math.min(height, total[at] * share[at] * scale);
		bars.push(["p-loc", x, base - low, low], ["p-card", x, base - height, height - low]);
		if (total[at] > top) bars.push(["ink-1", x, base - height - 2, 1]);
	}
	// One colour after the other: changing it is what takes the time.
	for (const colour of ["p-loc", "p-card", "ink-1"]) {
		g.fillStyle = ink.get(colour);
		for (const [own, x, y, height] of bars) if (own === colour) g.fillRect(x, y, 1, height);
	}
	if (reference)
		drawStairs(
			pen,
			reference,
			{ low: reference[name], high: reference[name] },
			top,
			ink.get("ink-2"),
			1,
			[4, 2],
		);
}

/**
 * Position errors: one line a track, the selected one or else the mean of all in front.
 * @param {Pen} pen
 * @param {Server.EvaluationSeries} series
 * @param {number | null} selection
 */
export function drawErrors(
	pen,
	{ track_errors: courses, mean_error: values, first, stride, axes },
	selection,
) {
	drawGround(pen);
	const { g, row, view, ink } = pen;
	const many = Math.max(1, Math.floor((view.last - view.first) / stride / view.width));
	/** @param {Course} course @param {string} colour @param {number} width */
	const draw = ({ first, values }, colour, width) => {
		g.beginPath();
		let open = false;
		const from = Math.max(0, Math.floor(bucketOf(view.first, { first, stride }) / many) * many);
		for (
			let k = from;
			k < values.length && first + k * stride <= view.last + many * stride;
			k += many
		) {
			const known = values.slice(k, k + many).filter((value) => value !== null);
			const worst = Math.min(axes.error, Math.max(0, ...known));
			if (known.length)
				g[open ? "lineTo" : "moveTo"](
					xOf(first + k * stride, view),
					row.y + row.height - 4 - (worst / axes.error) * (row.height - 10),
				);
			open = known.length > 0;
		}
		stroke(g, colour, width);
	};
	const chosen = courses.find(({ track }) => track === selection);
	for (const course of courses)
		if (course !== chosen) draw(course, faded(ink.id(course.track), 0.35), 1);
	if (chosen) draw(chosen, ink.id(chosen.track), 1.75);
	else draw({ first, values }, ink.get("p-est"), 1.25);
}
