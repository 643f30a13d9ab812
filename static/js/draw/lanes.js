// @ts-check
/** Range bar, ruler and track lanes of the timeline. */
import { rangesOf, tickSteps, xOf } from "../clock.js";
import { longMisses } from "../events.js";
import { faded } from "../palette.js";
import { hatch, stroke } from "./canvas.js";

/**
 * Loaded pictures thin and grey, the computed part in the accent's colour on top.
 * @param {Brush} g @param {Row} row @param {View} view
 * @param {{loaded: Iterable<number>, done: number, frames: number}} state
 * @param {Palette} ink
 */
export function drawRange(g, row, view, { loaded, done, frames }, ink) {
	const y = row.y + Math.round(row.height / 2) - 2;
	const bar = (/** @type {number} */ from, /** @type {number} */ to, /** @type {number} */ top, /** @type {number} */ height) => {
		const x0 = Math.max(0, xOf(from, view));
		const x1 = Math.min(view.width, xOf(to, view));
		if (x1 >= x0) g.fillRect(x0, top, Math.max(1.5, x1 - x0), height);
	};
	g.fillStyle = ink.get("bg-3");
	bar(0, frames - 1, y, 6);
	g.fillStyle = ink.get("loaded");
	for (const [from, to] of rangesOf(loaded)) bar(from, to, y, 6);
	g.fillStyle = ink.get("accent");
	if (done > 0) bar(0, done - 1, y + 3, 3);
}

/**
 * @param {Brush} g @param {Row} row @param {View} view
 * @param {{range: [number | null, number | null]}} state
 * @param {Palette} ink
 */
export function drawRuler(g, row, view, { range }, ink) {
	const bottom = row.y + row.height;
	const { major, minor } = tickSteps(view);
	g.font = `${ink.get("fs-0")} ${ink.font}`;
	g.textBaseline = "middle";
	for (let step = Math.ceil(view.first / minor) * minor; step <= view.last; step += minor) {
		const x = Math.round(xOf(step, view)) + 0.5;
		const labelled = Math.round(step % major) === 0;
		g.beginPath();
		g.moveTo(x, bottom - (labelled ? 5 : 3));
		g.lineTo(x, bottom);
		stroke(g, ink.get(labelled ? "ink-3" : "bg-4"), 1);
		if (!labelled) continue;
		const text = String(Math.round(step));
		const half = g.measureText(text).width / 2;
		g.fillStyle = ink.get("ink-3");
		g.textAlign = x < half ? "left" : x > view.width - half ? "right" : "center";
		g.fillText(text, x, row.y + (row.height - 4) / 2);
	}
	range.forEach((step, end) => {
		if (step === null || step < view.first || step > view.last) return;
		const x = Math.round(xOf(step, view));
		g.fillStyle = ink.get("accent");
		g.beginPath();
		g.moveTo(x, bottom);
		g.lineTo(x, bottom - 7);
		g.lineTo(x + (end ? -5 : 5), bottom - 7);
		g.closePath();
		g.fill();
	});
	g.beginPath();
	g.moveTo(0, bottom - 0.5);
	g.lineTo(view.width + 20, bottom - 0.5);
	stroke(g, ink.get("line"), 1);
}

/**
 * @param {Brush} g
 * @param {Row} block  where lanes may be drawn
 * @param {View} view
 * @param {object} state
 * @param {TrackLane[]} state.tracks  in the order of the lanes
 * @param {number} state.scroll  pixels that the lanes are scrolled by
 * @param {number} state.laneHeight
 * @param {number} state.done
 * @param {number} state.fps
 * @param {number | null} state.selection
 * @param {number | null} state.hover
 * @param {Switch[]} state.switches
 * @param {Palette} ink
 */
export function drawLanes(g, block, view, { tracks, scroll, laneHeight, done, fps, selection, hover, switches }, ink) {
	g.save();
	g.beginPath();
	g.rect(0, block.y, view.width + 20, block.height);
	g.clip();
	const first = Math.max(0, Math.floor(scroll / laneHeight));
	const last = Math.min(tracks.length, Math.ceil((scroll + block.height) / laneHeight));
	for (let index = first; index < last; index += 1) {
		const track = tracks[index];
		const y = block.y + index * laneHeight - scroll;
		if (track.id === selection || track.id === hover) {
			g.fillStyle = track.id === selection ? ink.get("sel") : ink.get("bg-2");
			g.fillRect(0, y, view.width + 20, laneHeight);
		}
		if (track.last < view.first || track.first > view.last) continue;
		drawLane(g, y + Math.round(laneHeight / 2), view, { track, done, fps, thick: Math.max(6, Math.round(laneHeight * 0.42)) }, ink);
	}
	const rows = new Map(tracks.map(({ id }, index) => [id, block.y + (index + 0.5) * laneHeight - scroll]));
	for (const { step, before, track } of switches) {
		if (step < view.first || step > view.last) continue;
		const x = xOf(step, view);
		const ends = [before, track].flatMap((id) => rows.get(id) ?? []);
		// A cross in both lanes and a line that joins them: here the identity went over.
		g.beginPath();
		for (const y of ends) {
			g.moveTo(x, ends[0]);
			g.lineTo(x, y);
		}
		stroke(g, ink.get("ink-3"), 1);
		g.beginPath();
		for (const y of ends) {
			g.moveTo(x - 3.5, y - 3.5);
			g.lineTo(x + 3.5, y + 3.5);
			g.moveTo(x - 3.5, y + 3.5);
			g.lineTo(x + 3.5, y - 3.5);
		}
		stroke(g, ink.get("bg-1"), 4.5);
		stroke(g, ink.get("ink-1"), 1.5);
	}
	g.restore();
}

/**
 * @param {Brush} g
 * @param {number} middle
 * @param {View} view
 * @param {{track: TrackLane, done: number, fps: number, thick: number}} lane
 * @param {Palette} ink
 */
function drawLane(g, middle, view, { track, done, fps, thick }, ink) {
	const colour = ink.id(track.id);
	const top = middle - Math.round(thick / 2);
	const misses = new Set(longMisses(track, fps).map(([from]) => from));
	for (const [from, to, kind] of track.spans) {
		if (to < view.first || from > view.last) continue;
		const x0 = Math.max(-4, xOf(from, view));
		const x1 = Math.min(view.width + 4, xOf(Math.min(to + 1, view.last), view));
		const wide = Math.max(1.5, x1 - x0);
		if (kind === "seen") {
			g.fillStyle = colour;
			g.fillRect(x0, top, wide, thick);
		} else if (misses.has(from) && wide > 6) {
			hatch(g, x0, top, wide, thick, faded(colour, 0.75));
			g.beginPath();
			g.rect(x0 + 0.5, top + 0.5, wide - 1, thick - 1);
			stroke(g, colour, 1);
		} else {
			g.beginPath();
			g.moveTo(x0, top + thick / 2);
			g.lineTo(x0 + wide, top + thick / 2);
			stroke(g, colour, 2, [2.5, 2]);
		}
	}
	const centre = top + thick / 2;
	g.fillStyle = ink.get("ink-1");
	if (track.first > 0 && track.first >= view.first) {
		const x = xOf(track.first, view);
		g.beginPath();
		g.moveTo(x - 5.5, centre - 4);
		g.lineTo(x - 0.5, centre);
		g.lineTo(x - 5.5, centre + 4);
		g.closePath();
		g.fill();
	}
	if (track.last < done - 1 && track.last < view.last) g.fillRect(xOf(track.last + 1, view) + 2, centre - 2.5, 5, 5);
}
