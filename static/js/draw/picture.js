/** One camera's picture with what lies over it, at any magnification. */
import { drawFloor } from "../cameras/floor.js";
import { drawEmptyPicture, drawOverlay } from "./overlay.js";
import { stroke } from "./canvas.js";

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
