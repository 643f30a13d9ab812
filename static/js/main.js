/** Wires the page: one store, one socket, one playback, and the panes that look at them. */
import { createActions, valuesOf } from "./state/actions.js";
import { fetcher, getJson, openStream } from "./state/api.js";
import { all, one } from "./elements/dom.js";
import { commandFor, commandOf, keyLabel, keyOf, perform, register } from "./state/commands.js";
import { mountCameras } from "./panes/cameras.js";
import { mountLayout } from "./panes/layout.js";
import { mountNotes } from "./panes/notes.js";
import { mountSheets } from "./panes/sheets.js";
import { mountSide } from "./inspector/side.js";
import { mountTeach } from "./inspector/teach.js";
import { mountTimeline } from "./panes/timeline.js";
import { mountTop } from "./panes/top.js";
import { mountView3d } from "./panes/view3d.js";
import { createPlayback } from "./play/playback.js";
import { createStore } from "./state/store.js";
import { readPlace, writePlace } from "./state/url.js";

/** What is remembered in this browser: how the page looks, never what it shows. */
const KEPT = /** @type {const} */ ([
	"tab",
	"layers2d",
	"laneOrder",
	"measure",
	"singleKeys",
	"layout",
]);

/** @returns {Partial<PageState>} */
function remembered() {
	try {
		return JSON.parse(localStorage.getItem("page") ?? "{}");
	} catch {
		return {};
	}
}

register(await getJson("/static/commands.json"));
const start = readPlace(location.search);
/** @type {Store<PageState>} */
const store = createStore(
	/** @type {PageState} */ ({
		link: "connecting",
		lostAt: 0,
		retryAt: 0,
		server: null,
		run: null,
		schema: null,
		sequence: null,
		frames: 0,
		fps: 25,
		cameras: [],
		sequences: [],
		basis: "",
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
		selection: start.place.selection,
		hover: null,
		layers3d: {},
		large: start.place.camera,
		tab: "tracks",
		eventKind: "",
		every: false,
		scores: null,
		measure: "ospa",
		laneOrder: "longest",
		layout: {},
		singleKeys: true,
		notes: [],
		...remembered(),
		layers2d: {
			measurements: true,
			estimates: false,
			boxes: true,
			samples: false,
			likelihood: false,
			foreground: false,
			trails: false,
			truth: true,
			...remembered().layers2d,
		},
		theme: document.documentElement.dataset.theme === "light" ? "light" : "dark",
	}),
);

const origin = Math.random().toString(36).slice(2);
let seeks = 0;
const playback = createPlayback(store, (step) =>
	stream.send({ type: "seek", step, origin: `${origin}.${(seeks += 1)}` }),
);
const actions = createActions({
	store,
	seek: playback.seek,
	send: (message) => stream.send(message),
	receive: (state) => receiveState(state),
});

/** @type {Context} */
const context = { store, playback, actions, retry: () => stream.retry(), press };
mountTop(one(".top"), context);
mountNotes(one(".notes"), context);
mountView3d(one(".view"), context);
mountCameras(one(".cams"), context);
mountSide(one(".side"), context);
mountTimeline(one(".time"), context);
mountTeach(one(".mosaic"), context);
mountSheets(context);
mountLayout(context);

for (const control of all("[data-command], [data-command-key]")) {
	const { command: name, commandKey } = control.dataset;
	const command = commandOf(name ?? commandKey ?? "");
	control.dataset.key = command.keys.slice(0, 1).map(keyLabel).join();
	if (!name) continue;
	control.dataset.tip ??= command.title;
	if (!control.textContent?.trim()) control.ariaLabel = command.title;
	control.addEventListener("click", () => perform(command, actions));
}
for (const chip of all("[data-layer2d], [data-layer3d]")) {
	const { layer2d, layer3d } = chip.dataset;
	const name = layer2d ?? layer3d ?? "";
	chip.addEventListener("click", () =>
		layer2d ? actions.toggleLayer2d(name) : actions.toggleLayer3d(name),
	);
	store.watch(
		["server", "sequence", "layers2d", "layers3d", "link"],
		({ server, sequence, layers2d, layers3d, link }) => {
			chip.ariaPressed = String(Boolean((layer2d ? layers2d : layers3d)[name]));
			chip.disabled = layer2d ? !sequence : link !== "open";
			chip.disabled ||= name === "truth" && !sequence?.has_truth;
			chip.hidden = name === "pinned" && !server?.pinned;
		},
	);
}

/** The place of the address is gone to once, when its sequence is open. */
let place = start.place;
if (start.unknown.length)
	actions.note(
		"warn",
		`The address has unknown parts: ${start.unknown.join(", ")}`,
		"The rest of it is followed.",
	);

/** Go to a place as far as the open sequence is the place's.  @param {Server.State} server */
function arrive(server) {
	const { sequence } = server;
	if (!sequence) return;
	const cameras = sequence.cameras.length;
	const usual = cameras > 2 ? 0 : null;
	// It may be that the place's sequence cannot be opened.
	if (place.sequence && place.sequence !== sequence.name)
		return store.set({ step: server.playhead, large: usual });
	const { step, camera, selection, values } = place;
	place = { sequence: null, step: null, selection: null, camera: null, values: null };
	store.set({
		step: Math.max(0, Math.min(sequence.frames - 1, step ?? server.playhead)),
		large: camera !== null && camera < cameras ? camera : usual,
	});
	if (selection !== null) actions.select(selection);
	if (values) void restore(server, values);
}

/**
 * Have these values, and the defaults for all others.
 * @param {Server.State} server
 * @param {Record<string, any>} values
 */
async function restore(server, values) {
	const others = server.changed.filter((key) => !(key in values));
	if (others.length) await actions.ask("POST", "parameters/reset", { keys: others });
	const differing = Object.entries(values).filter(
		([key, value]) => String(server.parameters[key]) !== String(value),
	);
	if (differing.length) await actions.change(Object.fromEntries(differing));
}

/** @param {Server.State} told @param {boolean} [streamed]  it came over the socket, in order */
function receiveState(told, streamed = false) {
	// A method is a choice like any other: it is listed, undone and taken up again with the values.
	const server = {
		...told,
		parameters: { ...told.parameters, ...told.methods, taught: told.teaching.key },
	};
	const before = store.get().server;
	const changed = before?.sequence?.key !== server.sequence?.key;
	// An answer to a request may be older than what the socket has brought since, and another
	// sequence comes with the socket's word on its playhead.
	if (!streamed && (!before || changed || server.version < before.version)) return;
	if (before?.sequence && !server.sequence) {
		// The server was started anew: when the same sequence is open again, go where we were.
		const { shown, selection, large } = store.get();
		place = {
			sequence: before.sequence.name,
			step: Math.max(0, shown),
			selection,
			camera: large,
			values: valuesOf(before),
		};
	}
	if (
		before === null &&
		place.sequence &&
		server.sequence?.name !== place.sequence &&
		server.opening?.name !== place.sequence
	) {
		void actions.open(place.sequence);
	}
	if (changed) {
		playback.clear(server.playhead);
		actions.forget();
		// What went wrong before it was opened is over.
		store.set({
			notes: store
				.get()
				.notes.filter(({ level }) => level !== "error" || !before || !server.sequence),
			basis: "",
			timeline: null,
			span: null,
			scores: null,
			result: null,
			shown: -1,
			step: 0,
			playing: 0,
			range: [null, null],
			loop: false,
			hover: null,
			selection: server.selection,
		});
	} else if (before) {
		actions.remember(before.parameters, server.parameters);
		if (before.selection !== server.selection) store.set({ selection: server.selection });
		// Whoever looks through a camera in 3D wants to see its picture.
		if (before.view !== server.view && typeof server.view === "number")
			store.set({ large: server.view });
	}
	const { sequence } = server;
	const same = sequence && JSON.stringify(sequence) === JSON.stringify(before?.sequence);
	if (!same)
		store.set({
			sequence,
			frames: sequence?.frames ?? 0,
			fps: sequence?.fps ?? 25,
			cameras: sequence?.cameras ?? [],
		});
	store.set({ server, run: server.run, layers3d: server.layers });
	// The first word on the theme is this browser's, later ones are everybody's.
	if (before) store.set({ theme: server.theme });
	else if (server.theme !== store.get().theme)
		void actions.ask("POST", "theme", { theme: store.get().theme });
	if (changed || (place.sequence && place.sequence === sequence?.name)) arrive(server);
	if (changed || before?.pinned?.key !== server.pinned?.key) void fetchScores();
	if (before === null || before.opening?.name !== server.opening?.name) void fetchSequences();
}

/**
 * The server shows this run from now on.
 * @param {string} run
 */
function showRun(run) {
	if (run === store.get().basis) return;
	store.set({ basis: run, timeline: null });
	void fetchTimeline();
}

/** What is asked for of a long recording: what is shown and as much again at either side. */
function part() {
	const [first, last] = store.get().span ?? [0, 1e9];
	const beside = last - first;
	return `first=${Math.max(0, Math.floor(first - beside))}&last=${Math.ceil(last + beside)}`;
}

const fetchTimeline = fetcher(async () => {
	if (!store.get().sequence) return;
	const timeline = await getJson(`/api/timeline?${part()}`);
	// Lanes of another run than the one that is shown would mix the two; its own news is on the way.
	if (timeline.run === store.get().basis) store.set({ timeline });
});

const fetchScores = fetcher(async () => {
	const { sequence, run } = store.get();
	// A run without a step has no figures; they come with its first news.
	if (!sequence?.has_truth || (!run?.done && run?.state !== "failed")) return;
	const told = (/** @type {string} */ what) => getJson(`/api/evaluation${what}`);
	const [evaluation, series, comparison] = await Promise.all([
		told(""),
		told(`/series?${part()}`),
		told("/comparison"),
	]);
	const reference = comparison && (await told(`/series?of=${comparison.against}&${part()}`));
	if (store.get().sequence?.key === sequence.key)
		store.set({ scores: { evaluation, series, reference } });
});

const fetchSequences = fetcher(async () =>
	store.set({ sequences: (await getJson("/api/sequences")).sequences }),
);
const fetchSchema = fetcher(async () => store.set({ schema: await getJson("/api/schema") }));

/** @param {any} message */
function receive(message) {
	switch (message.type) {
		case "state":
			receiveState(message.state, true);
			break;
		case "progress":
			if (message.run.key === store.get().server?.run.key) store.set({ run: message.run });
			break;
		case "playhead":
			// Of our own seeks the newest counts too: the server may have come to it after another's.
			if (
				store.get().sequence &&
				(!message.origin.startsWith(origin) || message.origin === `${origin}.${seeks}`)
			)
				playback.follow(message.step);
			break;
		case "step":
			showRun(message.run);
			playback.receive(message);
			break;
		case "timeline":
			showRun(message.run);
			void fetchTimeline();
			break;
		case "evaluation":
			void fetchScores();
			break;
		case "notice":
			actions.note(message.level, message.message, message.hint ?? "");
			break;
		case "command":
			// Keys inside our own frame come here by themselves; this is for a 3D view in a window of its
			// own.
			if (document.hasFocus() && document.activeElement === one("iframe")) break;
			perform(commandOf(message.name), actions);
			break;
	}
}

// Also for a click inside the 3D view, which the server hears of first.
const still = matchMedia("(prefers-reduced-motion: reduce)");
const tellMotion = () => stream.send({ type: "motion", flies: !still.matches });
still.onchange = tellMotion;

const stream = openStream("/api/stream", {
	open() {
		tellMotion();
		store.set({ link: "open" });
		if (!store.get().schema) void fetchSchema();
		void fetchSequences();
		void fetchTimeline();
		void fetchScores();
	},
	lost(retryAt) {
		const { link, lostAt, server, shown, selection, large } = store.get();
		// A server that was started anew stands at its own first step: go back to where we are.
		if (link === "open" && server?.sequence)
			place = {
				sequence: server.sequence.name,
				step: Math.max(0, shown),
				selection,
				camera: large,
				values: valuesOf(server),
			};
		store.set({ link: "lost", retryAt, playing: 0, lostAt: link === "lost" ? lostAt : Date.now() });
	},
	message: receive,
});

/**
 * Run the command of a key, unless somebody types.
 * @param {KeyboardEvent} event
 * @returns {boolean} whether there was one
 */
function press(event) {
	const key = keyOf(event);
	const target = /** @type {Element} */ (event.target);
	const open = document.querySelector("dialog[open]");
	if (open && !(open.matches(".help") ? key === "?" : key === "Ctrl+k")) return false;
	if (
		key !== "Ctrl+k" &&
		target.matches?.("input:not([type=range], [type=checkbox]), textarea, [contenteditable=true]")
	)
		return false;
	// In a list letters and arrows choose.
	if (!key.startsWith("Ctrl+") && target.matches?.("select")) return false;
	// Space on a focused control presses that control.
	if (key === "Space" && target.closest?.("button, a, summary, input, [role=button]")) return false;
	const command = commandFor(key, store.get().singleKeys);
	if (!command) return false;
	event.preventDefault();
	perform(command, actions);
	return true;
}
document.addEventListener("keydown", press);

// A click leaves the focus where it was, so that Space goes on meaning play; only the 3D view,
// which keeps all keys to itself while it has the focus, gives it back.
document.addEventListener("mousedown", (event) => {
	if (document.activeElement instanceof HTMLIFrameElement) document.activeElement.blur();
	if (event.target instanceof Element && event.target.closest("button, tr, .cam"))
		event.preventDefault();
});

store.on(["span"], () => {
	void fetchTimeline();
	void fetchScores();
});
store.on(["theme"], ({ theme }) => {
	document.documentElement.dataset.theme = theme;
	playback.repaint();
});
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

/** The address without the step: what the back button goes back over. */
let standing = "";
/** @type {Timer} */
let writing;
store.on(["shown", "selection", "large", "server"], () => {
	// Browsers limit how often the address may change; while it plays, it follows slowly.
	writing ??= setTimeout(() => {
		writing = undefined;
		const { server, shown, selection, large } = store.get();
		if (!server?.sequence || shown < 0 || server.opening) return;
		const here = {
			sequence: server.sequence.name,
			step: shown,
			selection,
			camera: large,
			values: valuesOf(server),
		};
		const search = writePlace(here);
		const next = writePlace({ ...here, step: null });
		if (search !== location.search)
			history[standing && next !== standing ? "pushState" : "replaceState"](
				here,
				"",
				search || location.pathname,
			);
		standing = next;
		document.title = `${server.sequence.name} · multiview-phd`;
	}, 400);
});
addEventListener("popstate", ({ state }) => {
	const { server } = store.get();
	if (!state || !server) return;
	place = state;
	standing = writePlace({ ...state, step: null });
	store.set({ playing: 0 });
	if (server.sequence?.name !== state.sequence) void actions.open(state.sequence);
	else {
		if (state.selection === null) actions.select(null);
		arrive(server);
	}
});
