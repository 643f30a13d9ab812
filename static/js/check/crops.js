/** A person cut out of a camera's picture, at any step: read once, kept a while. */
import { drawEmptyPicture } from "../draw/overlay.js";
import { prepare } from "../draw/canvas.js";
import { getJson, request } from "../state/api.js";
import { shownVersion, versionOf } from "../state/events.js";
import { pictureName } from "../play/cache.js";

/** Kept at most: results of steps, and decoded pictures. */
const RESULTS = 240;
const PICTURES = 48;

/**
 * What is asked for by name once, the oldest forgotten.
 * @template V
 * @param {number} most @param {(name: string) => Promise<V>} load @param {(value: V) => void} [dispose]
 */
function memory(most, load, dispose) {
	/** @type {Map<string, Promise<V>>} */
	const kept = new Map();
	return (/** @type {string} */ name) => {
		const found = kept.get(name) ?? load(name);
		kept.delete(name);
		kept.set(name, found);
		found.catch(() => kept.delete(name));
		for (const [old, value] of kept) {
			if (kept.size <= most) break;
			kept.delete(old);
			if (dispose) value.then(dispose, () => {});
		}
		return found;
	};
}

/** @param {Store<PageState>} store */
export function createCrops(store) {
	const results = memory(RESULTS, async (name) => {
		const [shown, step] = name.split("/");
		/** @type {Server.Step} */
		const result = await getJson(`/api/step/${step}`);
		if (shown !== versionOf(result)) throw new Error(`the server shows run ${result.run} by now`);
		return result;
	});
	const pictures = memory(
		PICTURES,
		async (name) => createImageBitmap(await (await request(name)).blob()),
		// Drawn at once when it is there: a while later nobody holds it any more.
		(bitmap) => setTimeout(() => bitmap.close(), 5000),
	);

	return {
		/** @param {number} step @returns {Promise<Server.Step | null>} */
		resultAt: (step) => results(`${shownVersion(store.get())}/${step}`).catch(() => null),
		/**
		 * A camera's picture; null where there is none.
		 * @param {number} camera @param {number} step @returns {Promise<ImageBitmap | null>}
		 */
		async pictureOf(camera, step) {
			const { sequence, cameras } = store.get();
			if (!sequence || !cameras[camera]?.has_pictures) return null;
			return pictures(pictureName(sequence.key, camera, step)).catch(() => null);
		},
	};
}

/**
 * Draw what is around a box: its person from the head to the hips, and some of the room.
 * @param {HTMLCanvasElement} canvas
 * @param {ImageBitmap | null} bitmap
 * @param {Box} box  pixels of the picture
 * @param {string} colour  of the outline where there is no picture
 */
export function drawCrop(canvas, bitmap, box, colour) {
	const { clientWidth: width, clientHeight: height } = canvas;
	const g = prepare(canvas, width, height);
	const [left, top, wide, tall] = box;
	// As high as two thirds of the person, but wide enough for all of it.
	const high = Math.max(tall * 0.72, (wide * 1.15 * height) / Math.max(1, width));
	const scale = height / high;
	const [x, y] = [left + wide / 2 - width / scale / 2, top - 0.1 * high];
	if (bitmap) {
		g.imageSmoothingQuality = "medium";
		g.drawImage(bitmap, -x * scale, -y * scale, bitmap.width * scale, bitmap.height * scale);
	} else {
		drawEmptyPicture(g, width, height);
		g.strokeStyle = colour;
		g.lineWidth = 2;
		g.strokeRect((left - x) * scale, (top - y) * scale, wide * scale, tall * scale);
	}
}
