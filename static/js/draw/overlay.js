/**
 * A picture and what is drawn over it. Dashed means "not seen by the current run here": truth and
 * coasting. Colour is the id's; the number is printed as well, but for a crowd in a small picture,
 * which numbers would hide: there those alone that are pointed at or selected.
 */
import { getJson } from "../state/api.js";
import { faded, stroke, trace } from "./canvas.js";

/* ---------- The grid on the room's floor in the pictures: it lies there as the calibration
   says. */

const LINE = "rgb(244 244 244 / .62)";
const EDGE = "#8ecbff";

/**
 * The open recording's grid, read when somebody first wants to see it.
 * @param {Store<PageState>} store
 * @param {() => void} repaint
 */
export function createFloor(store, repaint) {
	/** @type {Server.Floor | null} */
	let floor = null;
	let known = "";
	store.watch(["layers2d", "server", "sequence"], async ({ layers2d, sequence }) => {
		if (!layers2d.floor || !sequence) return;
		// Another room has another floor; what it is of is asked for once.
		const wanted = JSON.stringify([sequence.key, sequence.room]);
		if (wanted === known) return;
		known = wanted;
		floor = null;
		const told = await getJson("/api/floor").catch(() => null);
		if (known !== wanted) return;
		if (told) floor = told;
		else known = "";
		repaint();
	});
	return {
		/** @param {number} camera */
		of: (camera) => (store.get().layers2d.floor ? floor?.cameras[camera] : undefined),
		/** Its spacing, where it is drawn. */
		words: () => (store.get().layers2d.floor && floor ? `floor grid ${floor.cell} m` : ""),
	};
}

/** @param {Brush} g @param {Server.CameraFloor} floor @param {number} scale */
function drawFloor(g, { lines, edges }, scale) {
	// A pixel's whole numbers are its middle.
	const path = (/** @type {[number, number][]} */ line) =>
		trace(
			g,
			line.map(([x, y]) => [(x + 0.5) * scale, (y + 0.5) * scale]),
		);
	for (const line of lines) stroke(path(line), LINE, 1, [], 0.3);
	for (const line of edges) stroke(path(line), EDGE, 1.75, [], 0.45);
}

/* ---------- One camera's picture with what lies over it, at any magnification. ---------- */

/** Of the loupe, CSS pixels, and as a share of its cell where that is small. */
const [RADIUS, OF_CELL] = [84, 0.42];

/**
 * What of a magnified picture is in its cell.
 * @param {Magnified | undefined} zoom
 * @param {number} width  of the cell, CSS pixels @param {number} height
 * @returns {Lens}
 */
export function lensOf(zoom, width, height) {
	const [k, x, y] = zoom ?? [1, 0.5, 0.5];
	const cut = (/** @type {number} */ centre, /** @type {number} */ side) =>
		Math.round(Math.max(0, Math.min((k - 1) * side, centre * k * side - side / 2)));
	return { k, left: cut(x, width), top: cut(y, height) };
}

/**
 * @param {Brush} g
 * @param {{bitmap: CanvasImageSource | null | undefined, maps: Picture[], faint: boolean,
 * floor: Server.CameraFloor | undefined, view: Server.CameraStep | undefined}} what
 * @param {Scene} scene  of the picture as it is
 * @param {Lens} lens
 */
export function drawPicture(g, { bitmap, maps, faint, floor, view }, scene, { k, left, top }) {
	const [width, height] = [scene.width * k, scene.height * k];
	g.save();
	g.translate(-left, -top);
	// Enlarged much, a pixel is a square: nothing is made up between two.
	g.imageSmoothingEnabled = scene.scale * k < 4;
	g.imageSmoothingQuality = "medium";
	if (!bitmap || faint) drawEmptyPicture(g, width, height);
	// One of another step, which stands for one that is missing, never passes for it.
	g.globalAlpha = faint ? 0.4 : 1;
	if (bitmap) g.drawImage(bitmap, 0, 0, width, height);
	g.globalAlpha = 1;
	for (const map of maps) if (map.bitmap) g.drawImage(map.bitmap, 0, 0, width, height);
	if (floor) drawFloor(g, floor, scene.scale * k);
	// The overlay is drawn at the scale that it is seen at: its lines stay thin.
	if (view) drawOverlay(g, view, { ...scene, scale: scene.scale * k, width, height });
	g.restore();
}

/**
 * A round glass over the picture, around a point of its cell.
 * @param {Brush} g
 * @param {Parameters<typeof drawPicture>[1]} what
 * @param {Scene} scene
 * @param {Lens} lens  that the picture is seen with
 * @param {{x: number, y: number}} point
 */
export function drawLoupe(g, what, scene, { k, left, top }, { x, y }) {
	const more = Math.max(4, k * 2.5);
	const radius = Math.min(RADIUS, OF_CELL * Math.min(scene.width, scene.height));
	const cut = (/** @type {number} */ at, /** @type {number} */ gone) =>
		Math.round(((at + gone) / k) * more - at);
	g.save();
	g.beginPath();
	g.arc(x, y, radius, 0, 7);
	g.clip();
	drawPicture(g, what, scene, { k: more, left: cut(x, left), top: cut(y, top) });
	g.restore();
	g.beginPath();
	g.arc(x, y, radius, 0, 7);
	stroke(g, "#f4f4f4", 2, [], 0.6);
}

/** As many as this in a small picture are a crowd. */
const CROWD = 9;
/** Letters of a name that are written. */
const LONGEST = 16;
const WHITE = "#f4f4f4";
/** Of samples: no track and no line has it. */
const SAMPLE = "#ffd84d";
/** Height of the plate over a track's box, CSS pixels. */
const PLATE = 16;

/**
 * @param {Box} box
 * @param {number} scale
 * @returns {number[]} left, top, right, bottom on whole pixels, so that thin lines stay thin
 */
const edges = ([left, top, width, height], scale) =>
	[left, top, left + width, top + height].map((v) => Math.round(v * scale) + 0.5);

/** @param {Brush} g @param {Box} box @param {number} scale */
function outline(g, box, scale) {
	const [x0, y0, x1, y1] = edges(box, scale);
	g.beginPath();
	g.rect(x0, y0, x1 - x0, y1 - y0);
	return g;
}

/** The corners of a box: a 2D estimate. @param {Brush} g @param {Box} box @param {number} scale */
function corners(g, box, scale) {
	const [x0, y0, x1, y1] = edges(box, scale);
	const arm = Math.max(3, Math.min(10, (x1 - x0) * 0.3, (y1 - y0) * 0.3));
	g.beginPath();
	for (const [x, y, sx, sy] of [
		[x0, y0, 1, 1],
		[x1, y0, -1, 1],
		[x1, y1, -1, -1],
		[x0, y1, 1, -1],
	]) {
		g.moveTo(x + sx * arm, y);
		g.lineTo(x, y);
		g.lineTo(x, y + sy * arm);
	}
	return g;
}

/**
 * Tracks whose box is in the picture, far to near.
 * @param {Server.CameraStep} view
 * @param {number | null} [only]  their id
 */
export function visibleTracks({ tracks }, only = null) {
	const shown = /** @type {(Server.CameraTrack & {box: Box})[]} */ (
		tracks.filter(({ id, visible, box }) => visible && box && (only === null || id === only))
	);
	return shown.sort((a, b) => a.box[1] + a.box[3] - b.box[1] - b.box[3]);
}

/**
 * Whether a picture is large enough for what is said beside its boxes, in whatever shape.
 * @param {number} width @param {number} height
 */
export const isRoomy = (width, height) => width * height > 260 * 146 && width > 120;

/** @param {Brush} g @param {Server.CameraStep} view @param {Scene} scene */
export function drawOverlay(g, view, scene) {
	const { layers, width, height, scale, opacity, alone, selection } = scene;
	const roomy = isRoomy(width, height);
	const tracks = visibleTracks(view, alone ? selection : null);
	g.globalAlpha = opacity;
	g.lineJoin = "miter";
	if (layers.samples && view.samples) drawSamples(g, view.samples, scale);
	if (layers.samples && view.dropped) drawDropped(g, view.dropped, tracks, scene);
	if (layers.trails) drawTrails(g, tracks, scene);
	if (layers.truth && roomy) {
		for (const { box, valid } of view.truth) {
			g.globalAlpha = opacity * (valid ? 1 : 0.5);
			if (box) stroke(outline(g, box, scale), "#fff", 1.25, [4, 3], 0.45);
		}
		g.globalAlpha = opacity;
		drawErrors(g, view, scene);
	}
	if (layers.measurements)
		view.measurements.forEach(({ box }, index) =>
			stroke(outline(g, box, scale), WHITE, index === scene.pointed ? 2.5 : 1, [], 0.4),
		);
	if (layers.estimates) {
		for (const { box } of view.estimates) stroke(corners(g, box, scale), WHITE, 1.75, [], 0.5);
		if (view.gates.length && roomy) drawGates(g, view, scene);
	}
	if (layers.boxes) drawTracks(g, tracks, scene, roomy);
	g.globalAlpha = 1;
}

/**
 * Gates, and the labels that the camera's events speak of.
 * @param {Brush} g
 * @param {Server.CameraStep} view
 * @param {Scene} scene
 */
function drawGates(g, { gates, estimates }, { scale, ink }) {
	for (const [x, y, xx, xy, yy] of gates) {
		const reach = Math.hypot((xx - yy) / 2, xy);
		// half axes: the roots of the matrix's eigenvalues
		const [long, short] = [reach, -reach].map(
			(r) => Math.sqrt(Math.max(0, (xx + yy) / 2 + r)) * scale,
		);
		g.beginPath();
		g.ellipse(x * scale, y * scale, long, short, Math.atan2(2 * xy, xx - yy) / 2, 0, 7);
		stroke(g, WHITE, 1, [1, 3], 0.3);
	}
	Object.assign(g, {
		font: `600 10px ${ink.font}`,
		textAlign: "left",
		textBaseline: "alphabetic",
		fillStyle: WHITE,
		strokeStyle: "rgb(0 0 0 / .6)",
		lineWidth: 3,
	});
	for (const { box, label } of estimates) {
		const [x, y] = [box[0] * scale + 3, (box[1] + box[3]) * scale - 4];
		g.strokeText(`${label}`, x, y);
		g.fillText(`${label}`, x, y);
	}
}

/**
 * The way of the feet: what was is drawn, what comes is hinted at.
 * @param {Brush} g
 * @param {Server.CameraTrack[]} tracks
 * @param {Scene} scene
 */
function drawTrails(g, tracks, { scale, ink, selection, opacity, fades }) {
	for (const { id, trail } of tracks) {
		const points = trail.map(([, x, y]) => [x * scale, y * scale]);
		const now = trail.findIndex(([step]) => step >= 0);
		stroke(trace(g, points.slice(Math.max(0, now))), ink.id(id), 1, [], 0.3);
		const past = points.slice(0, now < 0 ? undefined : now + 1);
		// In a few pieces, the oldest faintest: a halo under each would make beads of them.
		const pieces = fades ? 8 : 1;
		for (let k = 0; k < pieces; k += 1) {
			const [from, to] = [k, k + 1].map((n) => Math.floor((n * (past.length - 1)) / pieces));
			g.globalAlpha = opacity * (fades ? (k + 1) / pieces : 1);
			const width = id === selection ? 2.5 : 1.75;
			stroke(trace(g, past.slice(from, to + 1)), ink.id(id), width, [], 0.4);
		}
		g.globalAlpha = opacity;
	}
}

/**
 * From where somebody is to where he was put: the colour says how far.
 * @param {Brush} g
 * @param {Server.CameraStep} view
 * @param {Scene} scene
 */
function drawErrors(g, { truth, tracks }, { scale, ink, people }) {
	for (const { id, track, error } of people) {
		const ends = [truth.find((t) => t.id === id)?.box, tracks.find((t) => t.id === track)?.box];
		if (!ends[0] || !ends[1] || error === null) continue;
		const middles = ends.flatMap((box) =>
			box ? [[(box[0] + box[2] / 2) * scale, (box[1] + box[3] / 2) * scale]] : [],
		);
		stroke(
			trace(g, middles),
			`color-mix(in srgb, ${ink.get("worse")} ${Math.min(100, 100 * error)}%, ${ink.get("better")})`,
			2.5,
			[],
			0.5,
		);
	}
}

/** @param {Brush} g @param {[number, number, number][]} samples @param {number} scale */
function drawSamples(g, samples, scale) {
	const heaviest = samples.reduce((most, [, , weight]) => Math.max(most, weight), 1e-12);
	const opacity = g.globalAlpha;
	for (const [x, y, weight] of samples) {
		g.globalAlpha = opacity * (0.25 + 0.75 * Math.sqrt(Math.max(0, weight) / heaviest));
		for (const [colour, size] of /** @type {[string, number][]} */ ([
			["rgb(0 0 0 / .7)", 4.5],
			[SAMPLE, 3],
		])) {
			g.fillStyle = colour;
			g.fillRect(Math.round(x * scale) - size / 2, Math.round(y * scale) - size / 2, size, size);
		}
	}
	g.globalAlpha = opacity;
}

/**
 * What was looked at and not believed: its box, and at which gate it fell, where neither another
 * word nor a track's box and its plate lie over that.
 * @param {Brush} g
 * @param {Server.Candidate[]} dropped
 * @param {{box: Box}[]} tracks
 * @param {Scene} scene
 */
function drawDropped(g, dropped, tracks, { scale, ink, width, height, layers }) {
	for (const { box } of dropped) stroke(outline(g, box, scale), SAMPLE, 1, [2, 3], 0.35);
	if (!isRoomy(width, height)) return;
	Object.assign(g, {
		font: `500 10px ${ink.font}`,
		textAlign: "left",
		textBaseline: "top",
		fillStyle: SAMPLE,
		strokeStyle: "rgb(0 0 0 / .7)",
		lineWidth: 3,
	});
	/** What is taken: x, y, width, height. @type {number[][]} */
	const taken = (layers.boxes ? tracks : []).map(({ box }) => {
		const [x, y, wide, high] = box.map((value) => value * scale);
		return [x, y - PLATE, wide, high + PLATE];
	});
	for (const { box, gate } of dropped) {
		const [x, y] = [box[0] * scale + 3, box[1] * scale + 3];
		const wide = g.measureText(gate).width + 4;
		if (
			taken.some(([tx, ty, tw, th]) => x < tx + tw && tx < x + wide && y < ty + th && ty < y + 12)
		)
			continue;
		taken.push([x, y, wide, 12]);
		g.strokeText(gate, x, y);
		g.fillText(gate, x, y);
	}
}

/**
 * @param {Brush} g
 * @param {(Server.CameraTrack & {box: Box})[]} tracks
 * @param {Scene} scene
 * @param {boolean} roomy
 */
function drawTracks(g, tracks, { scale, selection, hover, ink, width, names }, roomy) {
	const huge = width > 800 ? 1.4 : 1;
	for (const { id, box, seen, fed_by: fed } of tracks) {
		const marked = id === selection || id === hover;
		if (marked && fed) stroke(outline(g, fed.box, scale), WHITE, 2, [], 0.6);
		outline(g, box, scale);
		if (marked) {
			g.fillStyle = faded(ink.id(id), 0.16);
			g.fill();
		}
		stroke(g, ink.id(id), (roomy ? 2.5 : 2) * huge + (marked ? 0.5 : 0), seen ? [] : [7, 4], 0.55);
	}
	const size = Math.round((roomy ? 15 : 13) * huge);
	Object.assign(g, {
		font: `600 ${Math.round((roomy ? 11 : 10) * huge)}px ${ink.font}`,
		textAlign: "center",
		textBaseline: "middle",
	});
	/** @type {[number, number, number][]} */
	const placed = [];
	const named = roomy || tracks.length < CROWD;
	for (const { id, box } of [...tracks].reverse()) {
		if (!named && id !== selection && id !== hover) continue;
		const text = roomy && names[id] ? `${id} ${names[id].slice(0, LONGEST)}` : String(id);
		const wide = Math.max(size + 1, Math.ceil(g.measureText(text).width) + 6);
		const top = Math.round(box[1] * scale);
		const y = top - size - 1 < 2 ? Math.max(2, top + 2) : top - size - 1;
		let x = Math.max(1, Math.min(width - wide - 1, Math.round(box[0] * scale) - 1));
		// The nearest person's tag keeps its corner; the others step aside.
		for (let k = 0; k < placed.length; k += 1) {
			const [px, py, pw] = placed[k];
			if (
				Math.abs(y - py) < size + 2 &&
				x < px + pw + 2 &&
				px < x + wide + 2 &&
				px + pw + 2 + wide < width
			) {
				x = px + pw + 2;
				k = -1;
			}
		}
		placed.push([x, y, wide]);
		for (const [colour, rim] of /** @type {[string, number][]} */ ([
			["rgb(0 0 0 / .55)", 1],
			[ink.id(id), 0],
		])) {
			g.fillStyle = colour;
			g.fillRect(x - rim, y - rim, wide + 2 * rim, size + 2 * rim);
		}
		g.fillStyle = ink.on(id);
		g.fillText(text, x + wide / 2, y + size / 2 + 0.5);
	}
}

/**
 * A camera without pictures: a border and a quiet grid.
 * @param {Brush} g
 * @param {number} width
 * @param {number} height
 */
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
