/**
 * The state of the page. One plain object, changed by `set`, read by everyone. Listeners name the keys they
 * depend on and are told once a turn, however many changes that turn brought.
 */

import { remember, remembered } from "../elements/dom.js";

/* ---------- What the page begins with, and what of it this browser remembers. ---------- */

/** Layers of the pictures, as they are at first. */
export const LAYERS_2D = {
	measurements: true,
	estimates: false,
	boxes: true,
	samples: false,
	likelihood: false,
	foreground: false,
	trails: false,
	floor: false,
	truth: true,
};

/** Layers in 3D, as they are at first. */
export const LAYERS_3D = {
	boxes: true,
	bodies: true,
	ellipsoids: true,
	trails: true,
	truth: false,
	volume: true,
	pinned: true,
	others: true,
};

/** How the page looks, never what it shows. */
const KEPT = /** @type {const} */ ([
	"tab",
	"layers2d",
	"laneOrder",
	"measure",
	"singleKeys",
	"layout",
	"dismissed",
	"realTime",
	"nearest",
	"turn",
	"plots",
	"layouts",
	"used",
]);

/** @returns {PageState} */
export function initialState() {
	/** @type {Partial<PageState>} */
	const kept = remembered("page", {});
	return {
		link: "connecting",
		lostAt: 0,
		retryAt: 0,
		server: null,
		run: null,
		study: null,
		schema: null,
		sequence: null,
		frames: 0,
		fps: 25,
		cameras: [],
		sequences: [],
		basis: "",
		revision: 0,
		timeline: null,
		span: null,
		step: 0,
		shown: -1,
		result: null,
		loaded: 0,
		playing: 0,
		speed: 1,
		loop: false,
		range: [null, null],
		selection: null,
		hover: null,
		pointed: null,
		zooms: {},
		loupe: false,
		follow: false,
		realTime: false,
		nearest: false,
		turn: "page",
		listed: "all",
		bookmarks: [],
		layers3d: {},
		wished3d: {},
		plots: [],
		layouts: {},
		used: [],
		large: null,
		tab: "tracks",
		sought: "",
		eventKind: "",
		every: false,
		scores: null,
		identity: null,
		tasks: {},
		measure: "ospa",
		laneOrder: "longest",
		layout: {},
		singleKeys: true,
		notes: [],
		asked: "",
		moved: false,
		place: "tune",
		signs: {},
		names: {},
		wantsStudy: false,
		dismissed: [],
		...kept,
		layers2d: { ...LAYERS_2D, ...kept.layers2d },
		theme: document.documentElement.dataset.theme === "light" ? "light" : "dark",
	};
}

/** From now on this browser remembers. @param {Store<PageState>} store */
export function keepLook(store) {
	store.on([...KEPT], (state) =>
		remember("page", Object.fromEntries(KEPT.map((key) => [key, state[key]]))),
	);
}

/**
 * @template {object} T
 * @param {T} initial
 * @param {(turn: () => void) => void} [schedule] when listeners are told; a microtask later by
 * default
 * @returns {Store<T>}
 */
export function createStore(initial, schedule = queueMicrotask) {
	let state = { ...initial };
	/** @type {Set<keyof T>} */
	let pending = new Set();
	/** @type {Set<{keys: (keyof T)[], listener: (state: Readonly<T>) => void}>} */
	const listeners = new Set();

	function flush() {
		const changed = pending;
		pending = new Set();
		for (const { keys, listener } of [...listeners])
			if (keys.some((key) => changed.has(key))) listener(state);
	}

	return {
		get: () => state,
		set(patch) {
			const next = { ...state, ...patch };
			const wasIdle = pending.size === 0;
			for (const key of /** @type {(keyof T)[]} */ (Object.keys(patch))) {
				if (!Object.is(state[key], next[key])) pending.add(key);
			}
			state = next;
			if (wasIdle && pending.size > 0) schedule(flush);
		},
		on(keys, listener) {
			const entry = { keys, listener };
			listeners.add(entry);
			return () => listeners.delete(entry);
		},
		watch(keys, listener) {
			listener(state);
			return this.on(keys, listener);
		},
	};
}
