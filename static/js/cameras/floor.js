/** The grid on the room's floor in the pictures: it lies there as the calibration says. */
import { stroke, trace } from "../draw/canvas.js";
import { getJson } from "../state/api.js";

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
export function drawFloor(g, { lines, edges }, scale) {
	// A pixel's whole numbers are its middle.
	const path = (/** @type {[number, number][]} */ line) =>
		trace(
			g,
			line.map(([x, y]) => [(x + 0.5) * scale, (y + 0.5) * scale]),
		);
	for (const line of lines) stroke(path(line), LINE, 1, [], 0.3);
	for (const line of edges) stroke(path(line), EDGE, 1.75, [], 0.45);
}
