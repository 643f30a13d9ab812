/** What is fetched ahead of the playhead: pictures of all cameras, results of steps. */
import { request } from "../state/api.js";

/* ---------- Pictures of all cameras around the playhead, decoded, within a budget of bytes. */

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

/**
 * Things that belong to a step, fetched ahead of the playhead, kept within a budget.
 * Used for pictures (by camera and step) and for results (by run and step).
 *
 * What is wanted comes as a list, most urgent first. Requests that fell out of the list are
 * aborted; what arrives is kept under its own name, so a late answer can never pass for another.
 * @template V
 * @param {CacheHow<V>} how
 * @returns {Kept<V>}
 */
export function createCache({
	load,
	sizeOf,
	budget,
	parallel = 4,
	arrived,
	dispose = () => {},
	failed,
}) {
	/** In the order of their last use, oldest first.  @type {Map<string, V>} */
	const kept = new Map();
	/** @type {Map<string, AbortController>} */
	const running = new Map();
	/** @type {string[]} */
	let wanted = [];
	let size = 0;

	/** @param {string} name */
	function forget(name) {
		const value = kept.get(name);
		if (value === undefined) return;
		kept.delete(name);
		size -= sizeOf(value);
		dispose(value);
	}

	/** @param {string} name @param {V} value */
	function put(name, value) {
		forget(name);
		kept.set(name, value);
		size += sizeOf(value);
		if (size <= budget) return;
		const needed = new Set(wanted);
		for (const old of [...kept.keys()]) {
			if (size <= budget) break;
			if (!needed.has(old) && old !== name) forget(old);
		}
	}

	function pump() {
		for (const name of wanted) {
			if (running.size >= parallel) return;
			if (!kept.has(name) && !running.has(name)) void start(name);
		}
	}

	/** @param {string} name */
	async function start(name) {
		const controller = new AbortController();
		running.set(name, controller);
		/** @type {V | undefined} */
		let value;
		try {
			value = await load(name, controller.signal);
		} catch (error) {
			if (!controller.signal.aborted) value = failed(name, error);
		}
		if (running.get(name) !== controller) {
			if (value !== undefined) dispose(value);
			return;
		}
		running.delete(name);
		if (value !== undefined) {
			put(name, value);
			arrived(name);
		} else {
			wanted = wanted.filter((other) => other !== name);
		}
		pump();
	}

	return {
		want(names) {
			wanted = names;
			const needed = new Set(names);
			for (const [name, controller] of running) {
				if (!needed.has(name)) {
					running.delete(name);
					controller.abort();
				}
			}
			pump();
		},
		get(name) {
			const value = kept.get(name);
			if (value !== undefined) {
				kept.delete(name);
				kept.set(name, value);
			}
			return value;
		},
		put,
		forget,
		clear() {
			for (const controller of running.values()) controller.abort();
			running.clear();
			wanted = [];
			for (const name of [...kept.keys()]) forget(name);
		},
		names: () => kept.keys(),
	};
}
