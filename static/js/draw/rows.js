/** The rows of the timeline: range bar, ruler and lanes, and the curves below them. */
import { rangesOf, tickSteps, xOf, bucketOf } from "../play/clock.js";
import { faded, hatch, rule, stroke, trace } from "./canvas.js";

/* ---------- Range bar, ruler and track lanes of the timeline. ---------- */

/**
 * Loaded pictures thin and grey, the computed part in the accent's colour on top.
 * @param {Pen} pen
 * @param {Iterable<number>} loaded
 * @param {number} done
 * @param {number} frames
 */
export function drawRange({ g, row, view, ink }, loaded, done, frames) {
	const y = row.y + Math.round(row.height / 2) - 2;
	/**
	 * @param {string} colour
	 * @param {number} from
	 * @param {number} to
	 * @param {number} top
	 * @param {number} height
	 */
	const bar = (colour, from, to, top, height) => {
		const [x0, x1] = [Math.max(0, xOf(from, view)), Math.min(view.width, xOf(to, view))];
		g.fillStyle = ink.get(colour);
		if (x1 >= x0) g.fillRect(x0, top, Math.max(1.5, x1 - x0), height);
	};
	bar("bg-3", 0, frames - 1, y, 6);
	for (const [from, to] of rangesOf(loaded)) bar("loaded", from, to, y, 6);
	if (done > 0) bar("accent", 0, done - 1, y + 3, 3);
}

/**
 * @param {Pen} pen
 * @param {[number | null, number | null]} range
 * @param {Bookmark[]} marks
 * @param {number | null} hidden  tick whose number is left out, since the playhead stands there
 */
export function drawRuler({ g, row, view, ink }, range, marks, hidden) {
	const bottom = row.y + row.height;
	const { major, minor } = tickSteps(view);
	g.font = `${ink.get("fs-0")} ${ink.font}`;
	g.textBaseline = "middle";
	for (let step = Math.ceil(view.first / minor) * minor; step <= view.last; step += minor) {
		const x = Math.round(xOf(step, view)) + 0.5;
		const labelled = Math.round(step % major) === 0;
		const colour = ink.get(labelled ? "ink-3" : "bg-4");
		rule(g, [x, bottom - (labelled ? 5 : 3)], [x, bottom], colour);
		if (!labelled || Math.round(step) === hidden) continue;
		const text = String(Math.round(step));
		const half = g.measureText(text).width / 2;
		g.fillStyle = ink.get("ink-3");
		g.textAlign = x < half ? "left" : x > view.width - half ? "right" : "center";
		g.fillText(text, x, row.y + (row.height - 4) / 2);
	}
	g.fillStyle = ink.get("warn");
	for (const { step } of marks) {
		if (step < view.first || step > view.last) continue;
		const x = Math.round(xOf(step, view));
		trace(g, [
			[x - 3, row.y + 1],
			[x + 3, row.y + 1],
			[x + 3, row.y + 9],
			[x, row.y + 6],
			[x - 3, row.y + 9],
		]).fill();
	}
	g.fillStyle = ink.get("accent");
	range.forEach((step, end) => {
		if (step === null || step < view.first || step > view.last) return;
		const x = Math.round(xOf(step, view));
		trace(g, [
			[x, bottom],
			[x, bottom - 7],
			[x + (end ? -5 : 5), bottom - 7],
		]).fill();
	});
	rule(g, [0, bottom - 0.5], [view.width + 20, bottom - 0.5], ink.get("line"));
}

/** @param {Pen} pen @param {Lanes} lanes */
export function drawLanes(
	pen,
	{ tracks, pinned, scroll, laneHeight, done, selection, hover, switches, decisions },
) {
	const { g, row, view, ink } = pen;
	g.save();
	g.beginPath();
	g.rect(0, row.y, view.width + 20, row.height);
	g.clip();
	const topOf = (/** @type {number} */ index) => row.y + index * laneHeight - scroll;
	const last = Math.min(tracks.length, Math.ceil((scroll + row.height) / laneHeight));
	for (let index = Math.max(0, Math.floor(scroll / laneHeight)); index < last; index += 1) {
		const track = tracks[index];
		if (track.id === selection || track.id === hover) {
			g.fillStyle = ink.get(track.id === selection ? "sel" : "bg-2");
			g.fillRect(0, topOf(index), view.width + 20, laneHeight);
		}
		const middle = topOf(index) + Math.round(laneHeight / 2);
		const below = topOf(index) + laneHeight - 1.5;
		for (const { like, spans } of pinned) {
			if (like !== track.id) continue;
			for (const [from, to] of spans) {
				const [x0, x1] = [xOf(from, view), xOf(to + 1, view)];
				const ends = [Math.max(-4, x0), Math.min(view.width + 4, x1)];
				rule(g, [ends[0], below], [ends[1], below], ink.get("ink-2"), 1, [4, 2]);
			}
		}
		if (track.last >= view.first && track.first <= view.last)
			drawLane(pen, track, middle, done, Math.max(5, Math.round(laneHeight * 0.42)));
	}
	const rows = new Map(tracks.map(({ id }, index) => [id, topOf(index + 0.5)]));
	for (const { step, before, track } of switches) {
		if (step < view.first || step > view.last) continue;
		const x = xOf(step, view);
		const ends = [before, track].flatMap((id) => rows.get(id) ?? []);
		// A cross in both lanes and a line that joins them: here the identity went over.
		stroke(
			trace(
				g,
				ends.map((y) => [x, y]),
			),
			ink.get("ink-3"),
			1,
		);
		g.beginPath();
		for (const y of ends) {
			for (const sign of [1, -1]) {
				g.moveTo(x - 3.5, y - 3.5 * sign);
				g.lineTo(x + 3.5, y + 3.5 * sign);
			}
		}
		stroke(g, ink.get("bg-1"), 4.5);
		stroke(g, ink.get("ink-1"), 1.5);
	}
	for (const { step, track, kind } of decisions) {
		const y = kind === "removed" ? row.y + 3 : rows.get(track);
		if (y !== undefined && step >= view.first && step <= view.last)
			drawDecision(pen, kind, xOf(step, view), y);
	}
	g.restore();
}

/**
 * What smoothing made otherwise: a link where pieces were joined, two edges where one was cut, and
 * over the lanes a small ring where somebody was taken away who has no lane any more.
 * @param {Pen} pen @param {Server.Decided["kind"]} kind @param {number} x @param {number} y
 */
function drawDecision({ g, ink }, kind, x, y) {
	g.beginPath();
	if (kind === "removed") g.arc(x, y, 2.5, 0, 7);
	else if (kind === "joined") g.ellipse(x, y, 5, 3, 0, 0, 7);
	else
		for (const side of [-2, 2]) {
			g.moveTo(x + side, y - 6);
			g.lineTo(x + side, y + 6);
		}
	stroke(g, ink.get("bg-1"), 4);
	stroke(g, ink.get(kind === "removed" ? "ink-3" : "ink-1"), 1.5);
}

/**
 * @param {Pen} pen
 * @param {Server.TrackLife} track
 * @param {number} middle
 * @param {number} done
 * @param {number} thick
 */
function drawLane({ g, view, ink }, track, middle, done, thick) {
	const colour = ink.id(track.id);
	const top = middle - Math.round(thick / 2);
	const centre = top + thick / 2;
	/** @type {Cell[]} */
	const missed = [];
	// Thousands of spans: each kind is one path a lane.
	g.fillStyle = colour;
	g.beginPath();
	for (const [from, to, kind] of track.spans) {
		if (to < view.first || from > view.last) continue;
		const x = Math.max(-4, xOf(from, view));
		const width = Math.max(
			1.5,
			Math.min(view.width + 4, xOf(Math.min(to + 1, view.last), view)) - x,
		);
		if (kind === "seen") g.fillRect(x, top, width, thick);
		else if (kind === "long miss" && width > 6) missed.push({ x, y: top, width, height: thick });
		else {
			g.moveTo(x, centre);
			g.lineTo(x + width, centre);
		}
	}
	stroke(g, colour, 2, [2.5, 2]);
	hatch(g, missed, faded(colour, 0.75));
	g.beginPath();
	for (const { x, width } of missed) g.rect(x + 0.5, top + 0.5, width - 1, thick - 1);
	stroke(g, colour, 1);
	g.fillStyle = ink.get("ink-1");
	const x = xOf(track.first, view);
	if (track.first > 0 && track.first >= view.first)
		trace(g, [
			[x - 5.5, centre - 4],
			[x - 0.5, centre],
			[x - 5.5, centre + 4],
		]).fill();
	if (track.last < done - 1 && track.last < view.last)
		g.fillRect(xOf(track.last + 1, view) + 2, centre - 2.5, 5, 5);
}

/* ---------- Plots over the steps, under the lanes and on the same axis. ---------- */

/**
 * How high a value stands in a strip; what leaves its axis is at the end of it.
 * @param {Pen["row"]} row @param {number} low @param {number} high  the ends of the axis
 */
export const levels =
	({ y, height }, low, high) =>
	(/** @type {number} */ value) =>
		y + height - 4 - ((Math.min(high, Math.max(low, value)) - low) / (high - low)) * (height - 10);

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
	const level = levels(row, 0, top);
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
	rule(g, [0, row.y + 0.5], [view.width + 20, row.y + 0.5], ink.get("line-0"));
	const base = row.y + row.height - 3.5;
	rule(g, [0, base], [view.width, base], ink.get("p-grid"));
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
	const level = levels(row, 0, top);
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
	const level = levels(row, 0, axes.error);
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
			if (known.length)
				g[open ? "lineTo" : "moveTo"](xOf(first + k * stride, view), level(Math.max(0, ...known)));
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
