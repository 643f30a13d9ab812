/** What the page begins with, and what of it this browser remembers. */
import { LAYERS_2D } from "./views.js";

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

/** @returns {Partial<PageState>} */
function remembered() {
	try {
		return JSON.parse(localStorage.getItem("page") ?? "{}");
	} catch {
		return {};
	}
}

/** @returns {PageState} */
export function initialState() {
	const kept = remembered();
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
		eventKind: "",
		every: false,
		scores: null,
		identity: null,
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
		undoable: [0, 0],
		...kept,
		layers2d: { ...LAYERS_2D, ...kept.layers2d },
		theme: document.documentElement.dataset.theme === "light" ? "light" : "dark",
	};
}

/** From now on this browser remembers. @param {Store<PageState>} store */
export function remember(store) {
	store.on([...KEPT], (state) => {
		try {
			localStorage.setItem(
				"page",
				JSON.stringify(Object.fromEntries(KEPT.map((key) => [key, state[key]]))),
			);
		} catch {
			// Without storage the page forgets; nothing else changes.
		}
	});
}
