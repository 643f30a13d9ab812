/** Wires the page: one store, one socket, one playback, and the panes that look at them. */
import { mountCameras } from "./cameras/cameras.js";
import { one } from "./elements/dom.js";
import { mountSide } from "./inspector/side.js";
import { mountDoor, mountControls, pressed } from "./panes/controls.js";
import { mountLayout } from "./panes/layout.js";
import { mountNotes } from "./panes/notes.js";
import { mountPlaces, mountTop } from "./panes/top.js";
import { mountView3d } from "./panes/view3d.js";
import { createPlayback } from "./play/playback.js";
import { createActions } from "./state/actions.js";
import { createAddress } from "./state/address.js";
import { getJson, openStream } from "./state/api.js";
import { register } from "./state/commands.js";
import { initialState, keepLook, createStore } from "./state/store.js";
import { createReceiver } from "./state/receiving.js";
import { mountTimeline } from "./timeline/timeline.js";

register(await getJson("/static/commands.json"));
/** @type {Store<PageState>} */
const store = createStore(initialState());
keepLook(store);

const origin = Math.random().toString(36).slice(2);
let seeks = 0;
const playback = createPlayback(store, (step) =>
	stream.send({ type: "seek", step, origin: `${origin}.${(seeks += 1)}` }),
);
const actions = createActions({
	store,
	seek: playback.seek,
	send: (message) => stream.send(message),
	receive: (state) => receiver.receiveState(state),
});
const address = createAddress(store, actions);
const receiver = createReceiver({
	store,
	playback,
	actions,
	address,
	// Of our own seeks the newest counts too: the server may have come to it after another's.
	isOld: (from) => from.startsWith(origin) && from !== `${origin}.${seeks}`,
});

/** @type {Context} */
const context = {
	store,
	playback,
	actions,
	retry: () => stream.retry(),
	press: (event) => pressed(event, store, actions),
};
mountTop(one(".top"), context);
mountPlaces(one(".places"), context);
mountNotes(one(".notes"), context);
mountView3d(one(".view"), context);
mountCameras(one(".cams"), context);
mountSide(one(".side"), context);
const timeline = mountTimeline(one(".time"), context);
mountDoor(context);
mountLayout(context);
/**
 * What is read after the first picture, or when it is first wanted; what it brings may be asked for
 * before.
 * @param {() => Promise<void>} read
 */
function later(read) {
	/** @type {Promise<void> | undefined} */
	let known;
	return () => (known ??= read().catch(() => void (known = undefined)));
}
const readRest = later(() =>
	import("./later.js").then(({ mountLater }) => mountLater(context, timeline)),
);
const readTeach = later(() =>
	import("./inspector/teach.js").then(({ mountTeach }) => mountTeach(one(".mosaic"), context)),
);
const readSheets = later(() =>
	import("./sheets/sheets.js").then(({ mountSheets }) => mountSheets(context)),
);
const readKeep = later(() =>
	import("./sheets/keep.js").then(({ mountKeep }) => mountKeep(context)),
);
const brought = /** @type {const} */ ([
	["bookmark", readRest],
	["checkIdentities", readRest],
	["plot", readRest],
	["correct", readRest],
	["drawTemplate", readTeach],
	["help", readSheets],
	["keepLayout", readSheets],
	["keepPicture", readKeep],
	["copyRun", readRest],
	["saveFile", readRest],
	["exportForms", readRest],
	["swap", readRest],
]);
for (const [name, read] of brought) {
	const early = async (/** @type {any[]} */ ...what) => {
		await read();
		if (actions[name] === early)
			return actions.note("error", "That is not read yet", "The server does not answer.");
		await /** @type {any} */ (actions)[name](...what);
	};
	actions[name] = early;
}
store.watch(["tab"], ({ tab }) => tab === "teach" && void readTeach());
// What is typed before it can offer anything stands in its field, and Enter takes the first offer.
const sought = /** @type {any} */ (one(".palette"));
sought.addEventListener("keydown", (/** @type {KeyboardEvent} */ { key }) =>
	sought.toggleAttribute("data-hasty", key === "Enter"),
);
actions.palette = () => {
	if (sought.open) return sought.close();
	sought.showModal();
	void readSheets();
};
mountControls(context);
void readRest();

// Also for a click inside the 3D view, which the server hears of first.
const still = matchMedia("(prefers-reduced-motion: reduce)");
const tellMotion = () => stream.send({ type: "motion", flies: !still.matches });
still.onchange = tellMotion;

const stream = openStream("/api/stream", {
	open() {
		tellMotion();
		store.set({ link: "open" });
		receiver.refresh();
	},
	lost(retryAt) {
		const { link, lostAt, server } = store.get();
		// A server that was started anew stands at its own first step: go back to where we are.
		if (link === "open" && server) address.returnTo(server);
		store.set({
			link: "lost",
			retryAt,
			playing: 0,
			lostAt: link === "lost" ? lostAt : Date.now(),
		});
	},
	message: receiver.receive,
});

// Who has chosen no theme has the system's.
const bright = matchMedia("(prefers-color-scheme: light)");
bright.onchange = () => {
	if (!("theme" in localStorage)) actions.toggleTheme(bright.matches ? "light" : "dark");
};

store.on(["theme"], ({ theme }) => {
	document.documentElement.dataset.theme = theme;
	playback.repaint();
});
