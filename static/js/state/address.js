/**
 * The address of the page: what is looked at and how, as words. The place that it names is gone to once its sequence is open, and written back as the
 * page moves on; back and forward go over what was chosen.
 */
import { remember, remembered } from "../elements/dom.js";
import { SPEEDS } from "../play/clock.js";
import { valuesOf } from "./actions.js";
import { LAYERS_2D, LAYERS_3D } from "./store.js";

/* ---------- The places of the page, in the order of the work; the hash of the address names one.
   Another place is another row; its module is read when somebody first goes there. */

/** @type {PageSite[]} */
export const PLACES = [
	{
		name: "tune",
		word: "Tune",
		tip: "3D, pictures and parameters on one clock",
		bench: true,
	},
	{
		name: "check",
		word: "Check",
		tip: "Doubtful moments, put right",
		bench: true,
		read: () => import("../check/check.js").then(({ mountCheck }) => mountCheck),
		exists: ({ sequence }) => sequence !== null,
	},
	{
		name: "study",
		word: "Study",
		tip: "Many runs at once: which values are better, and which matter",
		read: () => import("../study/study.js").then(({ mountStudy }) => mountStudy),
		sign: ({ study }) =>
			study?.state === "running"
				? [study.done, study.trials].filter((count) => count !== null).join("/")
				: "",
	},
	{
		name: "library",
		word: "Library",
		tip: "Recordings and runs that are kept",
		read: () => import("../library/library.js").then(({ mountLibrary }) => mountLibrary),
	},
];

/** The place that a hash names; the first one where it names none. @param {string} hash */
export const placeOf = (hash) => (PLACES.find(({ name }) => `#${name}` === hash) ?? PLACES[0]).name;

/** Whether a place is the workbench with its clock. @param {string} place */
export const isBench = (place) => PLACES.some(({ name, bench }) => bench && name === place);

/* ---------- How something is looked at, as words of an address: only what is not as at first.
   Nothing here touches the page. */

const EVENTS = ["birth", "death", "switch", "long miss", "joined", "cut", "removed", "doubt"];
/** The tabs of the side panel; each has a button and a panel in the markup. */
export const TABS = /** @type {const} */ ([
	"tracks",
	"step",
	"events",
	"teach",
	"parameters",
	"compare",
	"runs",
	"place",
]);

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
		read(text) {
			const wanted = text === "changes" ? "parameters" : text; // its name in earlier addresses
			const tab = TABS.find((name) => name === wanted);
			return tab ? { tab } : null;
		},
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
const VIEW_KEYS = Object.keys(KEYS);

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

/* ---------- A place as text: the address that shows a colleague the same. ---------- */

const KNOWN = ["seq", "step", "sel", "cam", "look", "a", ...VIEW_KEYS];

/**
 * @param {string} search  with or without the question mark
 * @returns {{place: Place, unknown: string[]}} keys that mean nothing here are named, not fatal
 */
export function readPlace(search) {
	const query = new URLSearchParams(search);
	const whole = (/** @type {string | null} */ text) =>
		text !== null && /^\d{1,9}$/.test(text) ? Number(text) : null;
	/** A camera's index; the address counts from 1, as the page does. */
	const index = (/** @type {string} */ key) => (whole(query.get(key)) || 0) - 1;
	/** Values by key; what differs from the defaults. @param {string} head */
	const valuesOf = (head) => {
		const found = [...query].filter(([key]) => key.startsWith(head));
		return found.length
			? Object.fromEntries(found.map(([key, text]) => [key.slice(head.length), text]))
			: null;
	};
	const look = query.get("look") === "top" ? "top" : index("look");
	return {
		place: {
			sequence: query.get("seq") || null,
			step: whole(query.get("step")),
			selection: whole(query.get("sel")),
			camera: index("cam") < 0 ? null : index("cam"),
			look: look === -1 ? null : look,
			values: valuesOf("p."),
			// Run A may stand at its defaults: then it is named alone.
			pinned: valuesOf("a.") ?? (query.has("a") ? {} : null),
			view: Object.fromEntries([...query].filter(([key]) => VIEW_KEYS.includes(key))),
		},
		unknown: [...query.keys()].filter((key) => !KNOWN.includes(key) && !/^[pa]\./.test(key)),
	};
}

/**
 * @param {Place} place
 * @returns {string} beginning with a question mark, or empty
 */
export function writePlace({ sequence, step, selection, camera, look, values, pinned, view }) {
	const query = new URLSearchParams();
	if (sequence) query.set("seq", sequence);
	if (step !== null) query.set("step", String(step));
	if (selection !== null) query.set("sel", String(selection));
	if (camera !== null) query.set("cam", String(camera + 1));
	if (look !== null) query.set("look", look === "top" ? look : String(look + 1));
	for (const [key, text] of Object.entries(view)) query.set(key, text);
	for (const [key, value] of Object.entries(values ?? {})) query.set(`p.${key}`, String(value));
	if (pinned && !Object.keys(pinned).length) query.set("a", "defaults");
	for (const [key, value] of Object.entries(pinned ?? {})) query.set(`a.${key}`, String(value));
	const text = query.toString();
	return text ? `?${text}` : "";
}

/** @type {Place} */
const NOWHERE = {
	sequence: null,
	step: null,
	selection: null,
	camera: null,
	look: null,
	values: null,
	pinned: null,
	view: {},
};

/** Milliseconds until the address follows: browsers limit how often it may change. */
const WRITE_AFTER = 400;

/** Under which this browser remembers where it was last: session, search, and the kept run. */
const LAST = "last";

/** @param {Store<PageState>} store @param {Actions} actions */
export function createAddress(store, actions) {
	const { place: named, unknown } = readPlace(location.search);
	/** Where to go as soon as its sequence is open. */
	let place = named;
	/** A run of the library that was shown there. @type {number | null} */
	let keptRun = null;
	/** The address without the step and the view: what the back button goes back over. */
	let standing = "";
	/** @type {Timer} */
	let writing;
	/** Values that were asked for and are not there yet: until then the page is at no place. */
	let restoring = 0;
	if (unknown.length)
		actions.note(
			"warn",
			`The address has unknown parts: ${unknown.join(", ")}`,
			"The rest of it is followed.",
		);

	/** Where the page is. @param {Server.State} server @returns {Place} */
	function here(server) {
		const { shown, selection, large } = store.get();
		return {
			sequence: server.sequence?.opened_as ?? null,
			step: Math.max(0, shown),
			selection,
			camera: large,
			look: server.view,
			values: valuesOf(server),
			pinned: server.pinned && valuesOf(server.pinned),
			view: viewOf(store.get()),
		};
	}

	/**
	 * Whether a sequence is the place's: by its name, or by what opens it.
	 * @param {Server.SequenceInfo | null} sequence
	 */
	const isThere = (sequence) =>
		Boolean(
			sequence && place.sequence && [sequence.name, sequence.opened_as].includes(place.sequence),
		);

	/**
	 * A server that was started since this browser was here last, and that nobody has used: go back
	 * to where it was left, unless the address or another recording says otherwise.
	 * @param {Server.State} server
	 */
	function takeUp(server) {
		if (location.search.length > 1) return;
		const { session, search, kept } = remembered(LAST, {});
		if (!search || session === server.session) return;
		const { place: last } = readPlace(search);
		const { sequence, opening } = server;
		const open = opening ? [opening.name] : sequence ? [sequence.name, sequence.opened_as] : null;
		if (open && !open.includes(last.sequence ?? "")) return;
		place = kept ? { ...last, values: null } : last;
		if (kept) keptRun = kept;
	}

	/** Open the place's sequence; where that fails, what is open is looked at as usual. */
	function open() {
		if (keptRun) void actions.openRun(keptRun, place.sequence ?? "");
		else if (place.sequence) void actions.open(place.sequence);
		keptRun = null;
	}

	/** Go to the place as far as the open sequence is the place's. @param {Server.State} server */
	function arrive(server) {
		const { sequence } = server;
		if (!sequence) return;
		const cameras = sequence.cameras.length;
		const usual = cameras > 2 ? 0 : null;
		// It may be that the place's sequence cannot be opened.
		if (place.sequence && !isThere(sequence))
			return store.set({ step: server.playhead, large: usual });
		const { step, camera, selection, look, values, pinned, view } = place;
		const linked = place.sequence !== null;
		// Those in 3D are the server's.
		const kept = { layers3d: server.layers };
		place = NOWHERE;
		store.set({
			step: Math.max(0, Math.min(sequence.frames - 1, step ?? server.playhead)),
			moved: step !== null,
			large: camera !== null && camera < cameras ? camera : usual,
			...(linked || Object.keys(view).length ? { ...viewFrom(view), ...kept } : {}),
		});
		// A link says all of it, also that nobody is selected and nothing looked through.
		if (linked || selection !== null) actions.select(selection);
		if (
			look !== server.view &&
			(linked || look !== null) &&
			(typeof look !== "number" || look < cameras)
		)
			actions.lookThrough(look);
		const { layers3d } = viewFrom(view);
		if (view.in3d && layers3d) void actions.ask("PATCH", "layers", { changes: layers3d });
		if (pinned && !server.pinned) void compare(pinned, values ?? {});
		else if (values) void restore(server, values);
	}

	/**
	 * Have a run of some values, pin it, and go on with others.
	 * @param {Record<string, any>} first @param {Record<string, any>} then
	 */
	async function compare(first, then) {
		const { server } = store.get();
		if (!server) return;
		const before = server.run.key;
		const another = await restore(server, first);
		const unsubscribe = store.on(["server", "run"], pinWhenDone);
		pinWhenDone();
		function pinWhenDone() {
			const { server: now, run } = store.get();
			if (run?.state === "failed" || now?.sequence?.key !== server?.sequence?.key) unsubscribe();
			// The answer to a change may still tell of the run before it.
			else if (run?.state === "done" && run.key === now?.run.key) {
				if (another && run.key === before) return;
				unsubscribe();
				void actions.ask("POST", "run/pin").then((state) => state && restore(state, then));
			}
		}
	}

	/**
	 * Have these values, and the defaults for all others.
	 * @param {Server.State} server
	 * @param {Record<string, any>} values
	 * @returns {Promise<boolean>} whether they were others
	 */
	async function restore(server, values) {
		const others = server.changed.filter((key) => !(key in values));
		const differing = Object.entries(values).filter(
			([key, value]) => String(server.parameters[key]) !== String(value),
		);
		restoring += 1;
		try {
			if (others.length) await actions.command("reset_parameters", { keys: others });
			if (differing.length) await actions.change(Object.fromEntries(differing));
		} finally {
			restoring -= 1;
		}
		return others.length + differing.length > 0;
	}

	function write() {
		writing = undefined;
		if (restoring) {
			writing = setTimeout(write, WRITE_AFTER);
			return;
		}
		const { server, shown } = store.get();
		if (!server?.sequence || shown < 0 || server.opening) return;
		const now = here(server);
		const search = writePlace(now);
		const next = writePlace({ ...now, step: null, view: {} });
		if (search !== location.search)
			history[standing && next !== standing ? "pushState" : "replaceState"](
				now,
				"",
				(search || location.pathname) + location.hash,
			);
		standing = next;
		remember(LAST, { session: server.session, search, kept: server.run.kept });
		document.title = `${server.sequence.name} · multiview-phd`;
	}
	const viewed = Object.values(KEYS).flatMap(({ first }) => Object.keys(first));
	const seen = /** @type {(keyof PageState)[]} */ ([
		"shown",
		"selection",
		"large",
		"server",
		"place",
		...viewed,
	]);
	// While it plays, the address follows slowly.
	store.on(seen, () => (writing ??= setTimeout(write, WRITE_AFTER)));
	addEventListener("popstate", ({ state }) => {
		const { server } = store.get();
		if (!state?.view || !server) return;
		place = state;
		standing = writePlace({ ...state, step: null, view: {} });
		store.set({ playing: 0 });
		if (isThere(server.sequence)) arrive(server);
		else open();
	});

	return {
		arrive,
		/** Whether the place still waits for this sequence. @param {Server.State} server */
		waitsFor: (server) => isThere(server.sequence),
		/** Of the first state: open what the address names, unless it is open. @param {Server.State} server */
		begin(server) {
			takeUp(server);
			if (keptRun || (!isThere(server.sequence) && server.opening?.name !== place.sequence)) open();
		},
		/** The server is away or was started anew: come back to here. @param {Server.State} server */
		returnTo(server) {
			if (server.sequence) place = here(server);
		},
	};
}
