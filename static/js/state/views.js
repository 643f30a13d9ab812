/**
 * How something is looked at, as words of an address: only what is not as at first. Nothing here
 * touches the page.
 */
import { SPEEDS } from "../play/clock.js";

const EVENTS = ["birth", "death", "switch", "long miss", "joined", "cut", "removed", "doubt"];
const TABS = ["tracks", "step", "events", "teach", "changes", "compare", "runs", "place"];

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

/** @param {Record<string, boolean>} all @param {string} text  those that are on */
const readLayers = (all, text) =>
	Object.fromEntries(Object.keys(all).map((name) => [name, text.split(".").includes(name)]));

/** @param {Record<string, boolean>} layers @returns {string} those that are on */
const layersOn = (layers) =>
	Object.keys(layers)
		.filter((name) => layers[name])
		.join(".") || "none";

/** @param {string} text @returns {[number, number] | null} two steps joined by a dash */
function pair(text) {
	const found = /^(\d{1,9})-(\d{1,9})$/.exec(text);
	const [from, to] = found ? [Number(found[1]), Number(found[2])] : [0, -1];
	return to > from ? [from, to] : null;
}

/**
 * Each key of the address: what is so at first, how it is written, and what it sets; null where
 * the text means nothing.
 * @type {Record<string, {
 *   first: Partial<PageState>,
 *   write: (state: Readonly<PageState>) => string | null,
 *   read: (text: string) => Partial<PageState> | null,
 * }>}
 */
const KEYS = {
	tab: {
		first: { tab: "tracks" },
		// That of Check is there alone.
		write: ({ tab, place }) => (tab === "place" && place !== "check" ? "tracks" : tab),
		read: (text) => (TABS.includes(text) ? { tab: /** @type {PageState["tab"]} */ (text) } : null),
	},
	zoom: {
		first: { span: null },
		write: ({ span }) => span && span.map(Math.round).join("-"),
		read: (text) => pair(text) && { span: pair(text) },
	},
	loop: {
		first: { loop: false, range: [null, null] },
		write: ({ loop, range: [from, to], frames }) =>
			loop ? `${from ?? 0}-${to ?? Math.max(1, frames - 1)}` : null,
		read: (text) => pair(text) && { loop: true, range: pair(text) ?? [null, null] },
	},
	speed: {
		first: { speed: 1 },
		write: ({ speed }) => String(speed),
		read: (text) => (SPEEDS.includes(Number(text)) ? { speed: Number(text) } : null),
	},
	layers: {
		first: { layers2d: LAYERS_2D },
		write: ({ layers2d }) => layersOn(layers2d),
		read: (text) => ({ layers2d: readLayers(LAYERS_2D, text) }),
	},
	in3d: {
		first: { layers3d: LAYERS_3D },
		write: ({ layers3d }) => layersOn(layers3d),
		read: (text) => ({ layers3d: readLayers(LAYERS_3D, text) }),
	},
	measure: {
		first: { measure: "ospa" },
		write: ({ measure }) => measure,
		read: (text) => (text === "gospa" ? { measure: text } : null),
	},
	list: {
		first: { listed: "all" },
		write: ({ listed }) => listed,
		read: (text) =>
			["false", "missed", "worst"].includes(text)
				? { listed: /** @type {PageState["listed"]} */ (text) }
				: null,
	},
	events: {
		first: { eventKind: "" },
		write: ({ eventKind }) => eventKind,
		read: (text) =>
			EVENTS.includes(text) ? { eventKind: /** @type {LaneEvent["kind"]} */ (text) } : null,
	},
	closer: {
		first: { zooms: {} },
		write: ({ zooms }) =>
			Object.entries(zooms)
				.map(([camera, [k, x, y]]) =>
					[Number(camera) + 1, k.toFixed(2), x.toFixed(3), y.toFixed(3)].join("~"),
				)
				.join(".."),
		read: (text) => {
			const all = text.split("..").map((one) => one.split("~").map(Number));
			return all.every((one) => one.length === 4 && one.every((n) => n >= 0 && n < 1e3))
				? { zooms: Object.fromEntries(all.map(([camera, k, x, y]) => [camera - 1, [k, x, y]])) }
				: null;
		},
	},
	lanes: {
		first: { laneOrder: "longest" },
		write: ({ laneOrder }) => laneOrder,
		read: (text) => (text === "born" ? { laneOrder: text } : null),
	},
};

/** The keys of an address that say how something is looked at. */
export const VIEW_KEYS = Object.keys(KEYS);

/** The words for what is not as at first. @param {Readonly<PageState>} state */
export function viewOf(state) {
	/** @type {Record<string, string>} */
	const words = {};
	for (const [key, { first, write }] of Object.entries(KEYS)) {
		const text = write(state);
		if (text !== null && text !== write({ ...state, ...first })) words[key] = text;
	}
	return words;
}

/** What the words set; what they do not name is as at first. @param {Record<string, string>} words */
export function viewFrom(words) {
	/** @type {Partial<PageState>} */
	const patch = {};
	for (const [key, { first, read }] of Object.entries(KEYS))
		Object.assign(patch, (key in words && read(words[key])) || first);
	return patch;
}
