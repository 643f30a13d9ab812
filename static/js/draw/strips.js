// @ts-check
/** Plots over the steps, under the lanes and on the same axis. */
import { bucketOf, xOf } from "../clock.js";
import { faded } from "../palette.js";
import { stroke } from "./canvas.js";

/**
 * A staircase: numbers of people hold for a whole step. Of many steps on one pixel the
 * lowest and the highest are drawn, so that a short change never disappears.
 * @param {Brush} g @param {Row} row @param {View} view
 * @param {Buckets} buckets
 * @param {{low: number[], high: number[]}} values
 * @param {number} top  value at the upper edge
 * @param {{colour: string, width: number, dash?: number[]}} pen
 */
export function drawStairs(g, row, view, buckets, values, top, { colour, width, dash }) {
	const { first, stride } = buckets;
	const from = Math.max(0, bucketOf(view.first, buckets));
	const to = Math.min(values.low.length - 1, bucketOf(view.last, buckets) + 1);
	if (to < from) return;
	const level = (/** @type {number} */ value) =>
		row.y + row.height - 4 - (Math.max(0, Math.min(value, top)) / top) * (row.height - 10);
	const many = Math.max(1, Math.floor((view.last - view.first) / stride / Math.max(1, view.width)));
	g.beginPath();
	g.moveTo(Math.max(0, xOf(first + from * stride, view)), level(values.low[from]));
	for (let k = from; k <= to; k += many) {
		const low = Math.min(...values.low.slice(k, k + many));
		const high = Math.max(...values.high.slice(k, k + many));
		const x = xOf(first + k * stride, view);
		g.lineTo(x, level(low));
		if (high !== low) g.lineTo(x, level(high));
		g.lineTo(Math.min(view.width, xOf(first + Math.min(k + many, to) * stride, view)), level(values.low[Math.min(k + many - 1, to)]));
	}
	stroke(g, colour, width, dash);
}

/**
 * The edge above a strip and the ground it stands on.
 * @param {Brush} g @param {Row} row @param {View} view
 * @param {Palette} ink
 */
function drawGround(g, row, view, ink) {
	g.beginPath();
	g.moveTo(0, row.y + 0.5);
	g.lineTo(view.width + 20, row.y + 0.5);
	stroke(g, ink.get("line-0"), 1);
	g.beginPath();
	g.moveTo(0, row.y + row.height - 3.5);
	g.lineTo(view.width, row.y + row.height - 3.5);
	stroke(g, ink.get("p-grid"), 1);
}

/**
 * Number of people: truth broad and grey, the reported targets thin over it.
 * @param {Brush} g @param {Row} row @param {View} view
 * @param {Timeline} timeline
 * @param {Palette} ink
 */
export function drawCardinality(g, row, view, timeline, ink) {
	drawGround(g, row, view, ink);
	const { count, truth } = timeline;
	let top = 2;
	for (const values of [count, truth]) for (const value of values?.high ?? []) top = Math.max(top, value);
	if (truth) drawStairs(g, row, view, timeline, truth, top * 1.1, { colour: ink.get("p-truth"), width: 3 });
	drawStairs(g, row, view, timeline, count, top * 1.1, { colour: ink.get("p-est"), width: 1.25 });
}

/**
 * A round upper end of the axis: a few spikes may leave it, so that the rest stays readable.
 * @param {(number | null)[]} values  none below 0
 * @returns {number} 0.1, 0.2, 0.5, 1, 2 …
 */
export function scaleOf(values) {
	const sorted = values.filter((value) => value !== null).sort((a, b) => a - b);
	const most = sorted[Math.ceil(sorted.length * 0.98) - 1] ?? 0;
	const ten = 10 ** Math.floor(Math.log10(Math.max(most, 0.1) + 1e-9));
	return ten * ([1, 2, 5].find((k) => k * ten >= most - 1e-9) ?? 10);
}

/**
 * A distance between the sets of people and estimates, stacked: how much of it is place, how
 * much is number. Of the steps on one pixel the worst is drawn; what leaves the axis is capped.
 * @param {Brush} g @param {Row} row @param {View} view
 * @param {Plots} plots
 * @param {Palette} ink
 */
export function drawParts(g, row, view, { total, place, top, buckets, reference, by }, ink) {
	drawGround(g, row, view, ink);
	const base = row.y + row.height - 4;
	const scale = (row.height - 10) / top;
	const slope = (view.last - view.first) / view.width;
	for (let x = 0; x < view.width; x += 1) {
		let at = bucketOf(view.first + x * slope, buckets);
		const next = Math.min(total.length, Math.max(at + 1, bucketOf(view.first + (x + 1) * slope, buckets)));
		if (at >= total.length) break;
		if (at < 0) continue;
		for (let k = at + 1; k < next; k += 1) if (total[k] > total[at]) at = k;
		const height = Math.min(total[at], top) * scale;
		const low = Math.min(height, total[at] * place[at] * scale);
		g.fillStyle = ink.get("p-loc");
		g.fillRect(x, base - low, 1, low);
		g.fillStyle = ink.get("p-card");
		g.fillRect(x, base - height, 1, height - low);
		g.fillStyle = ink.get("ink-1");
		if (total[at] > top) g.fillRect(x, base - height - 2, 1, 1);
	}
	const other = reference?.[by];
	if (reference && other) drawStairs(g, row, view, reference, { low: other, high: other }, top, { colour: ink.get("ink-2"), width: 1, dash: [4, 2] });
}

/**
 * Position errors: one line a track, the selected one or else the mean of all in front.
 * @param {Brush} g @param {Row} row @param {View} view
 * @param {Plots} plots
 * @param {number | null} selection
 * @param {Palette} ink
 */
export function drawErrors(g, row, view, { courses, mean, buckets, most: top }, selection, ink) {
	drawGround(g, row, view, ink);
	const base = row.y + row.height - 4;
	const { stride } = buckets;
	const many = Math.max(1, Math.floor((view.last - view.first) / stride / view.width));
	const line = (/** @type {Course} */ { first, values }, /** @type {string} */ colour, /** @type {number} */ width) => {
		let open = false;
		g.beginPath();
		const from = Math.max(0, Math.floor(bucketOf(view.first, { first, stride }) / many) * many);
		for (let k = from; k < values.length && first + k * stride <= view.last + many * stride; k += many) {
			const known = values.slice(k, k + many).filter((value) => value !== null);
			if (known.length) {
				const y = base - (Math.min(top, Math.max(...known)) / top) * (row.height - 10);
				if (open) g.lineTo(xOf(first + k * stride, view), y);
				else g.moveTo(xOf(first + k * stride, view), y);
			}
			open = known.length > 0;
		}
		stroke(g, colour, width);
	};
	const chosen = courses.find(({ track }) => track === selection);
	for (const course of courses) if (course !== chosen) line(course, faded(ink.id(course.track), 0.35), 1);
	if (chosen) line(chosen, ink.id(chosen.track), 1.75);
	else line({ first: buckets.first, values: mean }, ink.get("p-est"), 1.25);
}

/**
 * @param {Course[]} courses
 * @param {number} count  of buckets
 * @param {Buckets} buckets
 * @returns {(number | null)[]} mean over those that have a value
 */
export function meanOf(courses, count, buckets) {
	return Array.from({ length: count }, (_, k) => {
		const values = courses.flatMap(({ first, values }) => values[k - bucketOf(first, buckets)] ?? []);
		return values.length ? values.reduce((sum, value) => sum + value, 0) / values.length : null;
	});
}
