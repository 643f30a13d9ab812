/** What a person can do: the page's own state at once, the server's by request. */
import { ApiError, getJson, sendCommand, sendJson } from "./api.js";
import { turned } from "../elements/dom.js";
import { SPEEDS, clampStep } from "../play/clock.js";
import { eventsNow, nextEvent, nextLayers, ordered } from "./events.js";

/** What differs from the defaults. @param {Pick<Server.State, "changed" | "parameters">} server */
export const valuesOf = ({ changed, parameters }) =>
	Object.fromEntries(changed.map((key) => [key, parameters[key]]));

/** Notes that are kept besides the newest: who dismisses one sees the next. */
const MOST_NOTES = 19;

/** Arrangements of the panes by name: shares of the window. @type {Record<string, PageState["layout"]>} */
const LAYOUTS = {
	tune: {},
	inspect: { right: 0.64, cams: 0.5 },
	compare: { right: 0.5, cams: 0.2, lanes: 0.2 },
};

/**
 * @param {object} how
 * @param {Store<PageState>} how.store
 * @param {(step: number) => void} how.seek
 * @param {(message: object) => boolean} how.send
 * @param {(state: Server.State) => void} how.receive
 * @returns {Actions}
 */
export function createActions({ store, seek, send, receive }) {
	let noteId = 0;
	let turn = Promise.resolve();
	/** Until the server has heard of all layers that were switched. */
	let switching = Promise.resolve();
	/** Layers that were on in pictures and off in 3D, or the other way round, before their key. */
	/** @type {Record<string, (boolean | undefined)[]>} */
	const mixed = {};
	/** The method of smoothing before it was switched off. @type {string | undefined} */
	let smoothing;
	const frames = () => store.get().frames;

	/**
	 * Have the server open a recording: this window knows then that nobody else did.
	 * @param {string} name  of the recording, or what opens it
	 * @param {string} path @param {object} [body]
	 */
	async function opening(name, path, body) {
		store.set({ asked: name });
		const state = await actions.ask("POST", path, body);
		if (!state) store.set({ asked: "" });
		return state;
	}

	/** @type {Actions} */
	const actions = {
		note(level, title, text, remedy, about) {
			const id = (noteId += 1);
			// The same thing said twice is one note.
			const { notes } = store.get();
			const times = 1 + (notes.find((other) => other.title === title)?.times ?? 0);
			const others = notes.filter((other) => other.title !== title);
			store.set({
				notes: [...others.slice(-MOST_NOTES), { id, level, title, text, remedy, about, times }],
			});
		},
		async noteEdit(title, text) {
			const state = await getJson("/api/state").catch(() => null);
			if (state) receive(state);
			const edit = state?.edits.undo;
			const act = () => void actions.undo(-1);
			actions.note("info", title, text, edit && { word: "Undo", act, edit });
		},
		refused(error, about) {
			if (!(error instanceof ApiError)) throw error;
			// This the socket tells, to all tabs.
			if (error.code === "cannot_open") return;
			// A value that was refused is back at what it was: nothing is left to mend.
			const level = error.code === "bad_parameter" ? "info" : "error";
			actions.note(level, error.message, error.hint ?? "", undefined, about);
		},
		accepted(about) {
			const { notes } = store.get();
			if (notes.some((note) => note.about === about))
				store.set({ notes: notes.filter((note) => note.about !== about) });
		},
		async ask(method, path, body) {
			const [about] = path.split("/");
			try {
				const answer = await sendJson(method, `/api/${path}`, body);
				actions.accepted(about);
				if (answer && typeof answer === "object" && "version" in answer) receive(answer);
				return answer;
			} catch (error) {
				actions.refused(error, about);
				return null;
			}
		},

		async command(name, fields) {
			try {
				const answer = await sendCommand(name, fields);
				actions.accepted(name);
				if (answer && "version" in answer) receive(answer);
				return answer ?? true;
			} catch (error) {
				actions.refused(error, name);
				return null;
			}
		},

		// play
		togglePlay() {
			const { playing, shown, range } = store.get();
			if (!frames()) return;
			if (!playing && shown >= (range[1] ?? frames() - 1)) seek(range[0] ?? 0);
			store.set({ playing: playing ? 0 : 1 });
		},
		shuttle(direction) {
			const { playing, speed } = store.get();
			if (!frames()) return;
			if (direction === 0) store.set({ playing: 0, speed: 1 });
			else if (playing === direction) actions.changeSpeed(1);
			else store.set({ playing: direction, speed: playing ? 1 : speed });
		},
		stepBy(steps) {
			store.set({ playing: 0 });
			seek(store.get().step + steps);
		},
		secondsBy: (seconds) => actions.stepBy(Math.round(seconds * store.get().fps)),
		changeSpeed(direction) {
			const index = SPEEDS.indexOf(store.get().speed) + direction;
			store.set({ speed: SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, index))] });
		},
		toggleLoop: () => store.set({ loop: !store.get().loop }),
		markRange(end) {
			const { shown, range } = store.get();
			/** @type {[number | null, number | null]} */
			const next = [...range];
			next[end] = range[end] === shown ? null : clampStep(shown, frames());
			// An end beyond the other one starts a new range.
			if (next[0] !== null && next[1] !== null && next[0] >= next[1]) next[1 - end] = null;
			store.set({ range: next, loop: next[0] !== null || next[1] !== null });
		},
		toEvent(direction) {
			const { step, eventKind } = store.get();
			const event = nextEvent(eventsNow(store.get()), step, direction);
			if (event) return void actions.go(`${event.step} ${event.id}`);
			const kind = eventKind || "event";
			actions.note("info", `No ${kind} ${direction > 0 ? "after" : "before"} step ${step}`, "");
		},

		// tracks
		select(id) {
			if (store.get().selection === id) return;
			store.set({ selection: id });
			send({ type: "select", id });
		},
		solo(id) {
			const { selection, layers3d } = store.get();
			const again = selection === id && layers3d.others === false;
			actions.select(id);
			if (again === (layers3d.others === false)) actions.toggleLayer3d("others");
		},
		nextTrack(direction) {
			const { timeline, laneOrder, selection } = store.get();
			const ids = ordered(timeline?.tracks ?? [], laneOrder).map((track) => track.id);
			const index = ids.indexOf(selection ?? -1);
			if (ids.length) actions.select(turned(ids, index, direction));
		},
		go(place) {
			const [step, id] = place.split(" ").map(Number);
			store.set({ playing: 0 });
			seek(step);
			actions.select(id);
		},
		clear() {
			if (store.get().server?.teaching.editing_room) actions.editRoom();
			else if (store.get().layout.max) actions.maximise(store.get().layout.max ?? null);
			else actions.select(null);
		},
		exportTracks: () => void actions.saveFile("/api/export/tracks.csv", "tracks.csv"),
		async saveFile() {},
		exportForms() {},

		// cameras and 3D
		chooseCamera(index) {
			const { cameras, large } = store.get();
			// One that is alone is as large as it can be in its pane.
			if (cameras.length === 1) actions.maximise("cams");
			else if (index < cameras.length) store.set({ large: large === index ? null : index });
		},
		lookThrough: (view) => void actions.ask("POST", "view", { camera: view }),
		freeView() {
			store.set({ large: null });
			actions.lookThrough(null);
		},
		toggleLayer(layer) {
			const { layers2d, layers3d } = store.get();
			const now = [layers2d[layer], layer === "boxes" ? undefined : layers3d[layer]];
			const [first, second] = nextLayers(now, mixed[layer]);
			if (now[0] !== undefined && now[1] !== undefined && now[0] !== now[1]) mixed[layer] = now;
			if (first !== now[0]) actions.toggleLayer2d(layer);
			if (second !== now[1]) actions.toggleLayer3d(layer);
		},
		toggleLayer2d(layer) {
			const { layers2d } = store.get();
			store.set({ layers2d: { ...layers2d, [layer]: !layers2d[layer] } });
		},
		toggleLayer3d(layer) {
			const { wished3d, layers3d } = store.get();
			const on = !layers3d[layer];
			const wished = { ...wished3d, [layer]: on };
			store.set({ wished3d: wished, layers3d: { ...layers3d, [layer]: on } });
			// One after the other: the last word counts.
			switching = switching.then(async () => {
				await actions.ask("PATCH", "layers", { changes: { [layer]: on } });
				const { wished3d: now, server } = store.get();
				if (now === wished) store.set({ wished3d: {}, layers3d: server?.layers ?? {} });
			});
		},

		// runs and parameters
		open: (name) => opening(name, "sequence", { name }),
		openRun: (number, recording) => opening(recording, `library/runs/${number}/open`),
		change: (changes) => actions.command("set_parameters", { changes }),
		reset: (...keys) => void actions.command("reset_parameters", keys.length ? { keys } : {}),
		preset: (name) => void actions.command("apply_preset", { preset: name }),
		savePreset: (name) => actions.command("save_preset", { preset: name }),
		renamePreset: (name, to) => actions.command("rename_preset", { preset: name, to }),
		removePreset: (name) => actions.command("remove_preset", { preset: name }),
		cancel: () => void actions.ask("POST", "run/cancel"),
		useAgain: (number) => void actions.command("use_again", { run: number }),
		runAgain: () => void actions.ask("POST", "run"),
		pin: (on) => void actions.ask(on ? "POST" : "DELETE", "run/pin"),
		hindsight() {
			const { server, schema } = store.get();
			const now = server?.parameters.smoothing_method;
			if (!now) return;
			if (now !== "none") smoothing = now;
			const usual = schema?.methods.smoothing_method.at(-1) ?? now;
			void actions.change({ smoothing_method: now !== "none" ? "none" : (smoothing ?? usual) });
		},
		async compareWith() {},
		async swap() {},
		undo(direction) {
			// Pressed again before the last answer came, it waits for its turn.
			const name = direction < 0 ? "undo" : "redo";
			turn = turn.then(async () => {
				if (store.get().server?.edits[name]) await actions.command(name);
				else actions.note("info", `Nothing to ${name}`, "");
			});
			return turn;
		},
		async copyRun() {},

		drawTemplate() {},
		editRoom: () =>
			void actions.command("edit_room", { on: !store.get().server?.teaching.editing_room }),
		saveTaught: () => void actions.command("save_taught"),

		// page
		showTab: (tab) =>
			store.set({
				tab,
				layout: { ...store.get().layout, ...(store.get().layout.max && { max: "side" }) },
			}),
		showTour: () =>
			store.set({ dismissed: store.get().dismissed.filter((name) => name !== "tour") }),
		toggleTheme(wished) {
			const theme = wished ?? (store.get().theme === "dark" ? "light" : "dark");
			store.set({ theme });
			try {
				if (!wished) localStorage.setItem("theme", theme);
			} catch {
				// Without storage the next start follows the system again.
			}
			void actions.ask("POST", "theme", { theme });
		},
		maximise(pane) {
			const { layout } = store.get();
			store.set({
				layout: pane === null ? {} : { ...layout, max: layout.max === pane ? undefined : pane },
			});
		},
		trail: (changes) => void actions.ask("PATCH", "trail", changes),
		fadeTrails: () => actions.trail({ fades: !store.get().server?.trail.fades }),
		arrange(name) {
			store.set({ layout: LAYOUTS[name] ?? store.get().layouts[name] ?? {} });
			if (name === "compare") actions.showTab("compare");
		},
		toggle: (what) => store.set({ [what]: !store.get()[what] }),
		async keepPicture() {},
		checkIdentities() {},
		nextTurn() {
			const { turn } = store.get();
			store.set({ turn: turn === "page" ? "centre" : turn === "centre" ? "off" : "page" });
		},
		wholePictures: () => store.set({ zooms: {}, follow: false, loupe: false }),
		// what the dialogs and the timeline put in place of these when they are there
		help() {},
		openSheet() {},
		palette() {},
		bookmark() {},
		correct() {},
		keepLayout() {},
		plot() {},
		zoom() {},
	};
	return actions;
}
