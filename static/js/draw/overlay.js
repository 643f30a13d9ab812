// @ts-check
/**
 * What is drawn over a picture. Dashed means "not seen by the current run here": truth and
 * coasting. Colour is the id's; the number is always printed as well.
 */
import { faded } from "../palette.js";
import { stroke } from "./canvas.js";

const WHITE = "#f4f4f4";

/** A box on whole pixels, so that thin lines stay thin. @param {Brush} g @param {Box} box @param {number} scale */
function trace(g, [left, top, width, height], scale) {
	const x = Math.round(left * scale);
	const y = Math.round(top * scale);
	g.beginPath();
	g.rect(x + 0.5, y + 0.5, Math.round((left + width) * scale) - x, Math.round((top + height) * scale) - y);
}

/** The corners of a box: a 2D estimate. @param {Brush} g @param {Box} box @param {number} scale */
function corners(g, [left, top, width, height], scale) {
	const x0 = Math.round(left * scale) + 0.5;
	const y0 = Math.round(top * scale) + 0.5;
	const x1 = Math.round((left + width) * scale) + 0.5;
	const y1 = Math.round((top + height) * scale) + 0.5;
	const arm = Math.max(3, Math.min(10, (x1 - x0) * 0.3, (y1 - y0) * 0.3));
	g.beginPath();
	for (const [x, y, sx, sy] of [[x0, y0, 1, 1], [x1, y0, -1, 1], [x1, y1, -1, -1], [x0, y1, 1, -1]]) {
		g.moveTo(x + sx * arm, y);
		g.lineTo(x, y);
		g.lineTo(x, y + sy * arm);
	}
}

/** Gates, and the labels that the camera's events speak of. @param {Brush} g @param {CameraStep} view @param {Scene} scene */
function drawGates(g, { gates, estimates }, { scale, ink }) {
	for (const [x, y, xx, xy, yy] of gates) {
		const reach = Math.hypot((xx - yy) / 2, xy);
		// eigenvalues
		const axes = [reach, -reach].map((r) => Math.sqrt(Math.max(0, (xx + yy) / 2 + r)) * scale);
		g.beginPath();
		g.ellipse(x * scale, y * scale, axes[0], axes[1], Math.atan2(2 * xy, xx - yy) / 2, 0, 7);
		stroke(g, WHITE, 1, [1, 3], 0.3);
	}
	g.font = `600 10px ${ink.font}`;
	g.textAlign = "left";
	g.textBaseline = "alphabetic";
	g.fillStyle = WHITE;
	g.strokeStyle = "rgb(0 0 0 / .6)";
	g.lineWidth = 3;
	for (const { box, label } of estimates) {
		const y = (box[1] + box[3]) * scale - 4;
		g.strokeText(`${label}`, box[0] * scale + 3, y);
		g.fillText(`${label}`, box[0] * scale + 3, y);
	}
}

/** @param {Brush} g @param {CameraStep} view @param {Scene} scene */
export function drawOverlay(g, view, scene) {
	const { layers, width, scale } = scene;
	const roomy = width > 260;
	g.globalAlpha = scene.opacity;
	g.lineJoin = "miter";
	if (layers.samples && view.samples) drawSamples(g, view.samples, scale);
	if (layers.trails) drawTrails(g, shown(view, scene), scene);
	if (layers.truth && roomy) {
		for (const { box, valid } of view.truth) {
			if (!box) continue;
			g.globalAlpha = scene.opacity * (valid ? 1 : 0.5);
			trace(g, box, scale);
			stroke(g, "#fff", 1.25, [4, 3], 0.45);
		}
		g.globalAlpha = scene.opacity;
		drawErrors(g, view, scene);
	}
	if (layers.measurements) {
		for (const { box } of view.measurements) {
			trace(g, box, scale);
			stroke(g, WHITE, 1, [], 0.4);
		}
	}
	if (layers.estimates) {
		for (const { box } of view.estimates) {
			corners(g, box, scale);
			stroke(g, WHITE, 1.75, [], 0.5);
		}
		if (view.gates.length && roomy) drawGates(g, view, scene);
	}
	if (layers.boxes) drawTracks(g, shown(view, scene), scene, roomy);
	g.globalAlpha = 1;
}

/**
 * Tracks whose box is in the picture, far to near.
 * @param {CameraStep} view
 * @returns {(TrackInView & {box: Box})[]}
 */
export function visibleTracks(view) {
	const tracks = /** @type {(TrackInView & {box: Box})[]} */ (view.tracks.filter((track) => track.visible && track.box));
	return tracks.sort((a, b) => a.box[1] + a.box[3] - b.box[1] - b.box[3]);
}

/** @param {CameraStep} view @param {Scene} scene */
const shown = (view, { alone, selection }) => visibleTracks(view).filter(({ id }) => !alone || id === selection);

/** The way of the feet: what was is drawn, what comes is hinted at. @param {Brush} g @param {TrackInView[]} tracks @param {Scene} scene */
function drawTrails(g, tracks, { scale, ink, selection }) {
	for (const { id, trail } of tracks) {
		for (const [points, width] of /** @type {[[number, number, number][], number][]} */ ([[trail.filter(([step]) => step >= 0), 1], [trail.filter(([step]) => step <= 0), id === selection ? 2.5 : 1.75]])) {
			g.beginPath();
			for (const [, x, y] of points) g.lineTo(x * scale, y * scale);
			stroke(g, ink.id(id), width, [], 0.4);
		}
	}
}

/** From where somebody is to where he was put: the colour says how far. @param {Brush} g @param {CameraStep} view @param {Scene} scene */
function drawErrors(g, { truth, tracks }, { scale, ink, people }) {
	for (const { id, track, error } of people) {
		const [from, to] = [truth.find((t) => t.id === id)?.box, tracks.find((t) => t.id === track)?.box];
		if (!from || !to || error === null) continue;
		g.beginPath();
		for (const [left, top, width, height] of [from, to]) g.lineTo((left + width / 2) * scale, (top + height / 2) * scale);
		stroke(g, `color-mix(in srgb, ${ink.get("worse")} ${Math.min(100, 100 * error)}%, ${ink.get("better")})`, 2.5, [], 0.5);
	}
}

/** @param {Brush} g @param {[number, number, number][]} samples @param {number} scale */
function drawSamples(g, samples, scale) {
	const heaviest = samples.reduce((most, [, , weight]) => Math.max(most, weight), 1e-12);
	const opacity = g.globalAlpha;
	for (const [x, y, weight] of samples) {
		const px = Math.round(x * scale);
		const py = Math.round(y * scale);
		g.globalAlpha = opacity * (0.25 + 0.75 * Math.sqrt(Math.max(0, weight) / heaviest));
		g.fillStyle = "rgb(0 0 0 / .5)";
		g.fillRect(px - 1.5, py - 1.5, 3, 3);
		g.fillStyle = WHITE;
		g.fillRect(px - 0.75, py - 0.75, 1.5, 1.5);
	}
	g.globalAlpha = opacity;
}

/** @param {Brush} g @param {(TrackInView & {box: Box})[]} tracks @param {Scene} scene @param {boolean} roomy */
function drawTracks(g, tracks, { scale, selection, hover, ink, width }, roomy) {
	const huge = width > 800 ? 1.4 : 1;
	for (const { id, box, seen, fed_by: fed } of tracks) {
		const marked = id === selection || id === hover;
		if (marked && fed) {
			trace(g, fed.box, scale);
			stroke(g, WHITE, 2, [], 0.6);
		}
		const colour = ink.id(id);
		trace(g, box, scale);
		if (marked) {
			g.fillStyle = faded(colour, 0.16);
			g.fill();
		}
		stroke(g, colour, (roomy ? 2.5 : 2) * huge + (marked ? 0.5 : 0), seen ? [] : [7, 4], 0.55);
	}
	const size = Math.round((roomy ? 15 : 13) * huge);
	g.font = `600 ${Math.round((roomy ? 11 : 10) * huge)}px ${ink.font}`;
	g.textAlign = "center";
	g.textBaseline = "middle";
	/** @type {[number, number, number][]} */
	const placed = [];
	for (const { id, box } of [...tracks].reverse()) {
		const text = String(id);
		const wide = Math.max(size + 1, Math.ceil(g.measureText(text).width) + 6);
		const above = Math.round(box[1] * scale) - size - 1;
		const y = above < 2 ? Math.max(2, Math.round(box[1] * scale) + 2) : above;
		let x = Math.max(1, Math.min(width - wide - 1, Math.round(box[0] * scale) - 1));
		// The nearest person's tag keeps its corner; the others step aside.
		for (let k = 0; k < placed.length; k += 1) {
			const [px, py, pw] = placed[k];
			if (Math.abs(y - py) < size + 2 && x < px + pw + 2 && px < x + wide + 2 && px + pw + 2 + wide < width) {
				x = px + pw + 2;
				k = -1;
			}
		}
		placed.push([x, y, wide]);
		g.fillStyle = "rgb(0 0 0 / .55)";
		g.fillRect(x - 1, y - 1, wide + 2, size + 2);
		g.fillStyle = ink.id(id);
		g.fillRect(x, y, wide, size);
		g.fillStyle = ink.on(id);
		g.fillText(text, x + wide / 2, y + size / 2 + 0.5);
	}
}

/** A camera without pictures: a border and a quiet grid. @param {Brush} g @param {number} width @param {number} height */
export function drawEmptyPicture(g, width, height) {
	g.fillStyle = "#1c1c1c";
	g.fillRect(0, 0, width, height);
	g.beginPath();
	for (let k = 1; k < 8; k += 1) g.rect(Math.round((width * k) / 8) + 0.5, 0, 0, height);
	for (let k = 1; k < 6; k += 1) g.rect(0, Math.round((height * k) / 6) + 0.5, width, 0);
	stroke(g, "#262626", 1);
	g.beginPath();
	g.rect(0.5, 0.5, width - 1, height - 1);
	stroke(g, "#3b3b3b", 1);
}
