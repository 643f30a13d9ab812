/** What all canvases share: their size, their pens and their colours. */
import { colourIndex } from "../elements/dom.js";

/* ---------- Colours for the canvases, read from the tokens once a theme. ---------- */

/** @param {Element} element  whose theme counts @returns {Palette} */
function read(element) {
	const style = getComputedStyle(element);
	/** @type {Map<string, string>} */
	const known = new Map();
	const get = (/** @type {string} */ name) => {
		let value = known.get(name);
		if (value === undefined) known.set(name, (value = style.getPropertyValue(`--${name}`).trim()));
		return value;
	};
	return {
		get,
		id: (id) => get(`id-${colourIndex(id)}`),
		on: (id) => get(`on-${colourIndex(id)}`),
		font: get("font"),
	};
}

/** @type {{theme: string, palette: Palette} | null} */
let current = null;
/** @type {Palette | null} */
let dark = null;

/** Colours of the chosen theme. */
export function palette() {
	const theme = document.documentElement.dataset.theme ?? "dark";
	if (current?.theme !== theme) current = { theme, palette: read(document.documentElement) };
	return current.palette;
}

/** Colours on pictures, which have no theme. */
export function pictureInk() {
	if (!dark) {
		const probe = document.createElement("i");
		probe.dataset.theme = "dark";
		probe.hidden = true;
		document.body.append(probe);
		dark = read(probe);
	}
	return dark;
}

/** @param {string} hex  #rrggbb @param {number} alpha  0 … 1 */
export function faded(hex, alpha) {
	return (
		hex +
		Math.round(alpha * 255)
			.toString(16)
			.padStart(2, "0")
	);
}

/**
 * Canvases that are written down and not drawn: what makes their brush.
 * @type {Map<HTMLCanvasElement, (real: Brush) => Brush>}
 */
export const writers = new Map();

/**
 * How canvases are drawn. Where a graphics card is emulated they are kept in plain memory, as those
 * that are read often: drawing by the emulation takes twice the time.
 */
export const drawing = { willReadFrequently: false };

/**
 * Fit a canvas to its element, in CSS pixels, and to the screen's pixels; clear it.
 * @param {HTMLCanvasElement} canvas
 * @param {number} width
 * @param {number} height
 */
export function prepare(canvas, width, height) {
	const ratio = devicePixelRatio || 1;
	const [w, hgt] = [width, height].map((side) => Math.max(1, Math.round(side * ratio)));
	if (canvas.width !== w || canvas.height !== hgt) Object.assign(canvas, { width: w, height: hgt });
	const g = /** @type {Brush} */ (canvas.getContext("2d", drawing));
	const writer = writers.get(canvas);
	if (writer) return writer(g);
	g.setTransform(ratio, 0, 0, ratio, 0, 0);
	g.clearRect(0, 0, width, height);
	return g;
}

/** A path through points. @param {Brush} g @param {number[][]} points  x and y of each */
export function trace(g, points) {
	g.beginPath();
	for (const [x, y] of points) g.lineTo(x, y);
	return g;
}

/**
 * A straight line.
 * @param {Brush} g @param {number[]} from @param {number[]} to @param {string} colour
 * @param {number} [width] @param {number[]} [dash]
 */
export const rule = (g, from, to, colour, width = 1, dash) =>
	stroke(trace(g, [from, to]), colour, width, dash);

/**
 * Stroke the current path, with a dark halo under it where it lies on a picture.
 * @param {Brush} g
 * @param {string} colour
 * @param {number} width
 * @param {number[]} [dash]
 * @param {number} [halo] its opacity
 */
export function stroke(g, colour, width, dash = [], halo = 0) {
	g.setLineDash(dash);
	if (halo > 0) {
		g.strokeStyle = `rgb(0 0 0 / ${halo})`;
		g.lineWidth = width + 2;
		g.stroke();
	}
	g.strokeStyle = colour;
	g.lineWidth = width;
	g.stroke();
	g.setLineDash([]);
}

/**
 * Slanted lines: not computed, or missed for long.
 * @param {Brush} g
 * @param {Cell[]} cells
 * @param {string} colour
 * @param {number} [gap]
 */
export function hatch(g, cells, colour, gap = 4) {
	if (!cells.length) return;
	g.save();
	g.beginPath();
	for (const { x, y, width, height } of cells) g.rect(x, y, width, height);
	g.clip();
	g.beginPath();
	// Lines hang on the page and not on the rectangle, so that they stand still while it grows.
	for (const { x, y, width, height } of cells) {
		for (let k = Math.floor((x - height) / gap) * gap; k < x + width; k += gap) {
			g.moveTo(k, y + height);
			g.lineTo(k + height, y);
		}
	}
	stroke(g, colour, 1);
	g.restore();
}
