/**
 * The place that the address names: gone to once its sequence is open, and written back as the
 * page moves on; back and forward go over what was chosen.
 */
import { valuesOf } from "./actions.js";
import { readPlace, writePlace } from "./url.js";
import { viewFrom, viewOf } from "./views.js";

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

/** Where this browser was last. @param {{session: string, search: string, kept: number | null}} last */
function note(last) {
	try {
		localStorage.setItem("last", JSON.stringify(last));
	} catch {
		// Without storage the next start begins anew.
	}
}

/** @returns {{session?: string, search?: string, kept?: number | null}} */
function recall() {
	try {
		return JSON.parse(localStorage.getItem("last") ?? "{}");
	} catch {
		return {};
	}
}

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
		const { session, search, kept } = recall();
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
		if (keptRun) void actions.ask("POST", `library/runs/${keptRun}/open`);
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
			if (others.length) await actions.ask("POST", "parameters/reset", { keys: others });
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
		note({ session: server.session, search, kept: server.run.kept });
		document.title = `${server.sequence.name} · multiview-phd`;
	}
	const seen = /** @type {const} */ ([
		"shown",
		"selection",
		"large",
		"server",
		"tab",
		"place",
		"span",
		"loop",
		"range",
		"speed",
		"layers2d",
		"measure",
		"laneOrder",
		"zooms",
		"listed",
		"eventKind",
	]);
	// While it plays, the address follows slowly.
	store.on([...seen], () => (writing ??= setTimeout(write, WRITE_AFTER)));
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
