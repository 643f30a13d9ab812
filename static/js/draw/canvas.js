// @ts-check
/** What all canvases share. */

/**
 * Fit a canvas to its element and the screen's pixels, and clear it.
 * @param {HTMLCanvasElement} canvas
 * @param {number} width  CSS pixels
 * @param {number} height  CSS pixels
 */
export function prepare(canvas, width, height) {
	const ratio = devicePixelRatio || 1;
	const w = Math.max(1, Math.round(width * ratio));
	const hgt = Math.max(1, Math.round(height * ratio));
	if (canvas.width !== w || canvas.height !== hgt) {
		canvas.width = w;
		canvas.height = hgt;
	}
	const g = /** @type {Brush} */ (canvas.getContext("2d"));
	g.setTransform(ratio, 0, 0, ratio, 0, 0);
	g.clearRect(0, 0, width, height);
	return g;
}

/**
 * Stroke the current path, with a dark halo under it where it lies on a picture.
 * @param {Brush} g
 * @param {string} colour
 * @param {number} width
 * @param {number[]} [dash]
 * @param {number} [halo]  opacity of the halo, 0 for none
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
 * @param {number} x
 * @param {number} y
 * @param {number} width
 * @param {number} height
 * @param {string} colour
 * @param {number} [gap]
 */
export function hatch(g, x, y, width, height, colour, gap = 4) {
	if (width <= 0 || height <= 0) return;
	g.save();
	g.beginPath();
	g.rect(x, y, width, height);
	g.clip();
	g.beginPath();
	// Lines hang on the page and not on the rectangle, so that they stand still while it grows.
	for (let k = Math.floor((x - height) / gap) * gap; k < x + width; k += gap) {
		g.moveTo(k, y + height);
		g.lineTo(k + height, y);
	}
	stroke(g, colour, 1);
	g.restore();
}
