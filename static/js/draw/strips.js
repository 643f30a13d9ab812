// @ts-check
/** Plots over the steps, under the lanes and on the same axis. */
import { xOf } from "../clock.js";
import { faded } from "../palette.js";
import { stroke } from "./canvas.js";

/**
 * A staircase: numbers of people hold for a whole step. Of many steps on one pixel the
 * lowest and the highest are drawn, so that a short change never disappears.
 * @param {Brush} g @param {Row} row @param {View} view
 * @param {number[]} values
 * @param {number} top  value at the upper edge
 * @param {{colour: string, width: number, dash?: number[]}} pen
 */
export function drawStairs(g, row, view, values, top, { colour, width, dash }) {
	const first = Math.max(0, Math.floor(view.first));
	const last = Math.min(values.length - 1, Math.ceil(view.last));
	if (last < first) return;
	const level = (/** @type {number} */ value) =>
		row.y + row.height - 4 - (Math.max(0, Math.min(value, top)) / top) * (row.height - 10);
	const perPixel = (view.last - view.first) / Math.max(1, view.width);
	const stride = Math.max(1, Math.floor(perPixel));
	g.beginPath();
	g.moveTo(Math.max(0, xOf(first, view)), level(values[first]));
	for (let step = first; step <= last; step += stride) {
		let low = values[step];
		let high = low;
		for (let k = step + 1; k < Math.min(step + stride, last + 1); k += 1) {
			low = Math.min(low, values[k]);
			high = Math.max(high, values[k]);
		}
		const x = xOf(step, view);
		g.lineTo(x, level(low));
		if (high !== low) g.lineTo(x, level(high));
		g.lineTo(Math.min(view.width, xOf(Math.min(step + stride, last), view)), level(values[Math.min(step + stride - 1, last)]));
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
 * @param {{count: number[], truth: number[] | null}} data
 * @param {Palette} ink
 */
export function drawCardinality(g, row, view, { count, truth }, ink) {
	drawGround(g, row, view, ink);
	let top = 2;
	for (const values of [count, truth ?? []]) for (const value of values) top = Math.max(top, value);
	if (truth) drawStairs(g, row, view, truth, top * 1.1, { colour: ink.get("p-truth"), width: 3 });
	drawStairs(g, row, view, count, top * 1.1, { colour: ink.get("p-est"), width: 1.25 });
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
 * @param {{total: number[], place: number[], top: number, reference: number[] | null}} data  place: share, 0 … 1
 * @param {Palette} ink
 */
export function drawParts(g, row, view, { total, place, top, reference }, ink) {
	drawGround(g, row, view, ink);
	const base = row.y + row.height - 4;
	const scale = (row.height - 10) / top;
	const slope = (view.last - view.first) / view.width;
	for (let x = 0; x < view.width; x += 1) {
		let step = Math.floor(view.first + x * slope);
		const next = Math.min(total.length, Math.max(step + 1, Math.floor(view.first + (x + 1) * slope)));
		if (step >= total.length) break;
		for (let k = step + 1; k < next; k += 1) if (total[k] > total[step]) step = k;
		const height = Math.min(total[step], top) * scale;
		const low = Math.min(height, total[step] * place[step] * scale);
		g.fillStyle = ink.get("p-loc");
		g.fillRect(x, base - low, 1, low);
		g.fillStyle = ink.get("p-card");
		g.fillRect(x, base - height, 1, height - low);
		g.fillStyle = ink.get("ink-1");
		if (total[step] > top) g.fillRect(x, base - height - 2, 1, 1);
	}
	if (reference) drawStairs(g, row, view, reference, top, { colour: ink.get("ink-2"), width: 1, dash: [4, 2] });
}

/**
 * Position errors: one line a track, the selected one or else the mean of all in front.
 * @param {Brush} g @param {Row} row @param {View} view
 * @param {{courses: (Course & {track: number})[], mean: (number | null)[], selection: number | null, top: number}} data
 * @param {Palette} ink
 */
export function drawErrors(g, row, view, { courses, mean, selection, top }, ink) {
	drawGround(g, row, view, ink);
	const base = row.y + row.height - 4;
	const stride = Math.max(1, Math.floor((view.last - view.first) / view.width));
	const line = (/** @type {Course} */ { first, values }, /** @type {string} */ colour, /** @type {number} */ width) => {
		let open = false;
		g.beginPath();
		const from = Math.max(0, Math.floor((view.first - first) / stride) * stride);
		for (let k = from; k < values.length && first + k <= view.last + stride; k += stride) {
			const known = values.slice(k, k + stride).filter((value) => value !== null);
			if (known.length) {
				const y = base - (Math.min(top, Math.max(...known)) / top) * (row.height - 10);
				if (open) g.lineTo(xOf(first + k, view), y);
				else g.moveTo(xOf(first + k, view), y);
			}
			open = known.length > 0;
		}
		stroke(g, colour, width);
	};
	const chosen = courses.find(({ track }) => track === selection);
	for (const course of courses) if (course !== chosen) line(course, faded(ink.id(course.track), 0.35), 1);
	if (chosen) line(chosen, ink.id(chosen.track), 1.75);
	else line({ first: 0, values: mean }, ink.get("p-est"), 1.25);
}

/**
 * @param {Course[]} courses
 * @param {number} steps
 * @returns {(number | null)[]} mean over those that have a value
 */
export function meanOf(courses, steps) {
	return Array.from({ length: steps }, (_, step) => {
		const values = courses.flatMap(({ first, values }) => values[step - first] ?? []);
		return values.length ? values.reduce((sum, value) => sum + value, 0) / values.length : null;
	});
}
