// @ts-check
/** What a person can do: the page's own state at once, the server's by request. */
import { ApiError, request, sendJson } from "./api.js";
import { SPEEDS, clampStep } from "./clock.js";
import { eventsNow, nextEvent, ordered } from "./events.js";

/**
 * Save what an address gives, once it is known that it gives it.
 * @param {string} path
 * @param {string} fallback  name of the file where the answer has none
 */
async function download(path, fallback) {
	const response = await request(path);
	const named = /filename="?([^";]+)"?/.exec(response.headers.get("content-disposition") ?? "");
	const link = document.createElement("a");
	link.href = URL.createObjectURL(await response.blob());
	link.download = named?.[1] ?? fallback;
	link.click();
	setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

/**
 * @param {object} parts
 * @param {Store<PageState>} parts.store
 * @param {(step: number) => void} parts.seek
 * @param {(message: object) => boolean} parts.send
 * @param {() => void} parts.help
 * @param {(state: ServerState) => void} parts.receive
 */
export function createActions({ store, seek, send, help, receive }) {
	let noteId = 0;
	/** Values before each change, newest last.  @type {Record<string, any>[]} */
	const history = [];

	/** @param {"info" | "warn" | "error"} level @param {string} title @param {string} text */
	function note(level, title, text) {
		const id = (noteId += 1);
		// The same thing said twice is one note.
		const others = store.get().notes.filter((other) => other.title !== title);
		store.set({ notes: [...others.slice(-3), { id, level, title, text }] });
		if (level === "info") setTimeout(() => store.set({ notes: store.get().notes.filter((other) => other.id !== id) }), 6000);
	}

	/** @param {unknown} error */
	function tell(error) {
		if (error instanceof ApiError) note("error", error.message, error.hint ?? "");
		else throw error;
	}

	/** @param {"POST" | "PATCH" | "DELETE"} method @param {string} path @param {object} [body] */
	async function ask(method, path, body) {
		try {
			const answer = await sendJson(method, path, body);
			if (answer && typeof answer === "object" && "version" in answer) receive(answer);
			return true;
		} catch (error) {
			tell(error);
			return false;
		}
	}

	const frames = () => store.get().server?.sequence?.frames ?? 0;
	const changeTo = (/** @type {Record<string, any>} */ changes) => ask("PATCH", "/api/parameters", { changes });

	/** @param {number | null} id */
	function select(id) {
		if (store.get().selection === id) return;
		store.set({ selection: id });
		send({ type: "select", id });
	}

	const page = {
		note,
		select,
		open: (/** @type {string} */ name) => ask("POST", "/api/sequence", { name }),
		change: changeTo,
		reset: (/** @type {string[]} */ ...keys) => ask("POST", "/api/parameters/reset", keys.length ? { keys } : {}),
		preset: (/** @type {string} */ name) => ask("POST", "/api/parameters/preset", { name }),
		cancel: () => ask("POST", "/api/run/cancel"),
		pin: (/** @type {boolean} */ on) => ask(on ? "POST" : "DELETE", "/api/run/pin"),
		runAgain: () => ask("POST", "/api/run"),
		chooseView(/** @type {number} */ camera) {
			store.set({ view3d: camera });
			void ask("POST", "/api/view", { camera: camera < 0 ? null : camera });
		},
		toggleLayer3d(/** @type {string} */ layer) {
			const layers3d = { ...store.get().layers3d, [layer]: !store.get().layers3d[layer] };
			store.set({ layers3d });
			void ask("PATCH", "/api/layers", { changes: { [layer]: layers3d[layer] } });
		},
		toggleLayer2d(/** @type {string} */ layer) {
			const { layers2d } = store.get();
			store.set({ layers2d: { ...layers2d, [layer]: !layers2d[layer] } });
		},
		async copy(/** @type {string} */ text) {
			try {
				await navigator.clipboard.writeText(text);
				return true;
			} catch {
				return false;
			}
		},
		/**
		 * Keep what the parameters were, whoever changed them; many changes of one drag are one.
		 * @param {Record<string, any>} before
		 * @param {Record<string, any>} after
		 */
		remember(before, after) {
			const old = Object.fromEntries(Object.keys(after).filter((key) => before[key] !== after[key]).map((key) => [key, before[key]]));
			if (Object.keys(old).length === 0) return;
			const now = performance.now();
			const last = history[history.length - 1];
			const same = last && now - rememberedAt < 1500 && Object.keys(old).every((key) => key in last);
			rememberedAt = now;
			if (same) return;
			history.push(old);
			if (history.length > 100) history.shift();
		},
		forget: () => history.splice(0),
	};
	let rememberedAt = -Infinity;
	let undoing = false;

	/** @type {Actions} */
	const actions = {
		togglePlay() {
			const { playing, shown, range } = store.get();
			if (!frames()) return;
			const last = range[1] ?? frames() - 1;
			if (!playing && shown >= last) seek(range[0] ?? 0);
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
		seekBy(seconds) {
			store.set({ playing: 0 });
			seek(store.get().step + Math.round(seconds * (store.get().server?.sequence?.fps ?? 25)));
		},
		toEnd(end) {
			store.set({ playing: 0 });
			seek(end === "first" ? 0 : frames() - 1);
		},
		changeSpeed(direction) {
			const { speed } = store.get();
			const index = SPEEDS.indexOf(speed);
			store.set({ speed: SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, index + direction))] });
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
			const event = nextEvent(eventsNow(store.get()), store.get().step, direction);
			if (!event) return;
			store.set({ playing: 0 });
			seek(event.step);
			select(event.id);
		},
		nextTrack(direction) {
			const { timeline, laneOrder } = store.get();
			const ids = ordered(timeline?.tracks ?? [], laneOrder).map((track) => track.id);
			if (!ids.length) return;
			const index = ids.indexOf(store.get().selection ?? -1);
			select(ids[index < 0 ? (direction > 0 ? 0 : ids.length - 1) : (index + direction + ids.length) % ids.length]);
		},
		chooseCamera(index) {
			const count = store.get().server?.sequence?.cameras.length ?? 0;
			if (index < count) store.set({ large: store.get().large === index ? null : index });
		},
		freeView() {
			store.set({ large: null });
			page.chooseView(-1);
		},
		toggleLayer(layer) {
			const { layers2d, layers3d } = store.get();
			if (layer === "truth") {
				// One key, one meaning: where both were different, both are on afterwards.
				const on = !(layers2d.truth && layers3d.truth);
				if (layers2d.truth !== on) page.toggleLayer2d("truth");
				if (layers3d.truth !== on) page.toggleLayer3d("truth");
			} else if (layer === "trails") page.toggleLayer3d("trails");
			else if (layer in layers2d) page.toggleLayer2d(layer);
		},
		clear: () => select(null),
		exportTracks() {
			void download("/api/export/tracks.csv", "tracks.csv").catch(tell);
		},
		toggleTheme: () => store.set({ theme: store.get().theme === "dark" ? "light" : "dark" }),
		help,
		undo() {
			const old = history.pop();
			if (!old || undoing) return;
			undoing = true;
			const length = history.length;
			void changeTo(old).then(() => {
				// The undo itself came back as a change; it is not one to undo.
				setTimeout(() => {
					history.length = Math.min(history.length, length);
					undoing = false;
				}, 300);
			});
		},
	};
	return { actions, page };
}
