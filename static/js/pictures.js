// @ts-check
/** Pictures of all cameras around the playhead, decoded, within a budget of bytes. */
import { request } from "./api.js";
import { createCache } from "./cache.js";

/**
 * A decoded picture, or why there is none.
 */

/** Decoded pictures kept, in bytes: a minute of two small cameras, some seconds of four large ones. */
export const PICTURE_BUDGET = 256 * 2 ** 20;

/**
 * @param {{sequence: string, camera: number, step: number}} what
 */
export function pictureName({ sequence, camera, step }) {
	return `${sequence}/${camera}/${step}`;
}

/** @param {(name: string) => void} arrived */
export function createPictures(arrived) {
	return createCache({
		load: async (name, signal) => {
			const response = await request(`/api/picture/${name}.jpg`, { signal });
			const bitmap = await createImageBitmap(await response.blob());
			return /** @type {Picture} */ ({ bitmap, missing: null });
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
