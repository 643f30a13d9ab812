/** Pictures of all cameras around the playhead, decoded, within a budget of bytes. */
import { request } from "../state/api.js";
import { createCache } from "./cache.js";

/**
 * Decoded pictures kept, in bytes: a minute of two small cameras, some seconds of four large ones.
 */
export const PICTURE_BUDGET = 256 * 2 ** 20;

/**
 * Their names are their addresses.
 * @param {string} sequence  its key
 * @param {number} camera
 * @param {number} step
 * @param {string} [kind]  of the picture itself, or of what is laid over it
 */
export const pictureName = (sequence, camera, step, kind = "picture") =>
	`/api/${kind}/${sequence}/${camera}/${step}.${kind === "picture" ? "jpg" : "png"}`;

/** The address of the one that stands for a picture that is missing. @param {string} name */
export const standIn = (name) => `${name}?nearest=true`;

/** What can be laid over a picture. */
const MAPS = /** @type {const} */ (["foreground", "likelihood"]);

/**
 * The addresses of what is laid over the pictures of a step, by camera.
 * @param {string} sequence  its key
 * @param {Server.Step} result
 * @param {Record<string, boolean>} layers
 */
export const mapNames = (sequence, result, layers) =>
	result.cameras.map((view, camera) =>
		MAPS.flatMap((kind) =>
			layers[kind] && view[kind]
				? [`${pictureName(sequence, camera, result.step, kind)}?run=${view[kind]}`]
				: [],
		),
	);

/** @param {(name: string) => void} arrived */
export function createPictures(arrived) {
	return createCache({
		load: async (name, signal) => {
			const response = await request(name, { signal });
			const bitmap = await createImageBitmap(await response.blob());
			const of = Number(response.headers.get("x-step") ?? NaN);
			return /** @type {Picture} */ ({ bitmap, missing: null, of });
		},
		sizeOf: ({ bitmap }) => (bitmap ? bitmap.width * bitmap.height * 4 : 64),
		budget: PICTURE_BUDGET,
		parallel: 4,
		arrived,
		dispose: ({ bitmap }) => bitmap?.close(),
		failed: (_name, error) => {
			const { status, message } = /** @type {{status?: number, message?: string}} */ (error ?? {});
			// An answer that is an error stays one; a server that is away may come back.
			return status ? { bitmap: null, missing: message ?? "no picture" } : undefined;
		},
	});
}
