/**
 * From the step that is asked for to the step that is painted.
 *
 * `step` is what is wanted, `shown` what stands on the screen. A step is painted when its
 * pictures and its result are there: all cameras, overlays, readout and playhead in one
 * animation frame. Until then the last whole step stays.
 */
import { getJson } from "../state/api.js";
import { isOld, shownVersion, versionOf } from "../state/events.js";
import {
	createCache,
	createPictures,
	mapNames,
	pictureName,
	standIn,
	PICTURE_BUDGET,
} from "./cache.js";
import { advance, clampStep, playedRange, prefetchWindow, restAfter3d, restOf3d } from "./clock.js";

/* ---------- Results of steps from the server: those that are asked for at once come by one
   request. */

/** @typedef {{ resolve: (result: Server.Step) => void, reject: (error: unknown) => void }} Waiting */

/** @returns {(step: number, query: string, signal: AbortSignal) => Promise<Server.Step>} */
function createStepLoader() {
	/** By what is asked for besides the step.  @type {Map<string, Map<number, Waiting>>} */
	let asked = new Map();

	function send() {
		const now = asked;
		asked = new Map();
		for (const [query, waiting] of now) if (waiting.size) void load(query, waiting);
	}

	/** @param {string} query @param {Map<number, Waiting>} waiting */
	async function load(query, waiting) {
		const steps = [...waiting.keys()].map((step) => `step=${step}`);
		try {
			/** @type {Server.Step[]} */
			const results = await getJson(`/api/steps?${steps.join("&")}${query}`);
			for (const result of results) waiting.get(result.step)?.resolve(result);
		} catch (error) {
			for (const { reject } of waiting.values()) reject(error);
		}
	}

	return (step, query, signal) =>
		new Promise((resolve, reject) => {
			if (asked.size === 0) setTimeout(send, 0);
			const waiting = asked.get(query) ?? new Map();
			asked.set(query, waiting);
			waiting.set(step, { resolve, reject });
			signal.addEventListener("abort", () => {
				waiting.delete(step);
				reject(signal.reason);
			});
		});
}

const RESULTS_KEPT = 600;

/** A seek further than this many steps is a jump. */
const JUMP = 12;
/** After a jump nothing else is read for so long, milliseconds: who jumps again needs all there is. */
const STILL = 200;

/** How long the 3D view is left alone at first where it is slow, milliseconds. */
const SLOW_3D = 1000;
/** Where it is slow it waits so long after another run or place came in sight, milliseconds. */
const LAST_3D = 400;

/** Steps that one request brings. */
const STEPS_AT_ONCE = 24;

/** How many steps of the shown run are there. @param {Readonly<PageState>} state */
export function shownDone({ basis, run, timeline }) {
	return run && basis === run.key ? run.done : (timeline?.done ?? 0);
}

/** @param {Store<PageState>} store @param {(step: number) => void} sendSeek */
export function createPlayback(store, sendSeek) {
	/** @type {((frame: Frame) => void)[]} */
	const painters = [];
	let frameAsked = false;
	let dirty = true;
	let windowDirty = true;
	let lastTick = 0;
	let rest = 0;
	let lastSent = -1;
	/** Since when, and for how long, the 3D view is left alone while it plays, milliseconds. */
	let [sentAt, wait] = [0, 0];
	/** So long it is left alone at least, since one of its frames held up the page, milliseconds. */
	let least = 0;
	/** Whether 3D is drawn without a graphics card, and when there was something new to see. */
	let [slow, newsAt] = [false, -Infinity];
	/** Around which step was read last, and since when that is.  */
	let [around, jumpedAt] = [0, -Infinity];
	/** @type {Timer} */
	let settling;

	const pictures = createPictures((name) => {
		store.set({ loaded: store.get().loaded + 1 });
		// Another may be wanted for one that is missing.
		windowDirty ||= store.get().nearest && Boolean(pictures.get(name)?.missing);
		ask();
	});

	const loadStep = createStepLoader();
	const results = createCache({
		load: async (name, signal) => {
			const [, step, query] = name.split("/");
			const result = await loadStep(Number(step), query, signal);
			const told = resultName(versionOf(result), result.step, query);
			if (name !== told) throw new Error(`asked for ${name}, the server shows ${told} by now`);
			return result;
		},
		sizeOf: () => 1,
		budget: RESULTS_KEPT,
		parallel: STEPS_AT_ONCE,
		arrived: (name) => {
			if (Number(name.split("/")[1]) === store.get().step) dirty = true;
			const { foreground, likelihood } = store.get().layers2d;
			windowDirty ||= foreground || likelihood;
			ask();
		},
		failed: () => {
			later();
			return undefined;
		},
	});

	/**
	 * @param {string} version  of the run
	 * @param {number} step
	 * @param {string} query  for what is not in every answer
	 */
	const resultName = (version, step, query) => `${version}/${step}/${query}`;

	/** What the layers need of a result besides what is always in it. */
	const queryNow = () => {
		const { layers2d, server } = store.get();
		const { samples, trails } = layers2d;
		const long = trails ? `&seconds=${server?.trail.seconds}` : "";
		return samples || trails ? `&samples=${Boolean(samples)}&trails=${Boolean(trails)}${long}` : "";
	};

	/** Try again after something failed that may come back. @param {number} [soon]  milliseconds */
	function later(soon = 500) {
		setTimeout(() => {
			windowDirty = true;
			ask();
		}, soon);
	}

	function ask() {
		if (frameAsked) return;
		frameAsked = true;
		requestAnimationFrame(tick);
	}

	/** @param {PageState} state */
	function refreshWindow(state) {
		windowDirty = false;
		const { sequence, step, speed, playing, layers2d, nearest, moved } = state;
		if (!sequence) {
			pictures.want([]);
			results.want([]);
			return;
		}
		const bytes = sequence.cameras.reduce(
			(sum, c) => sum + (c.has_pictures ? c.width * c.height * 4 : 0),
			0,
		);
		const how = { frames: sequence.frames, fps: sequence.fps, speed, direction: playing };
		const most = Math.min(400, Math.floor((PICTURE_BUDGET * 0.9) / Math.max(1, bytes)));
		if (Math.abs(step - around) > JUMP) {
			jumpedAt = performance.now();
			clearTimeout(settling);
			settling = setTimeout(later, STILL, 0);
		}
		around = step;
		const still = playing || performance.now() - jumpedAt >= STILL;
		const steps = still ? prefetchWindow(step, { ...how, most }) : [step];
		// Of a recording at which somebody only looks no more pictures are read than are seen.
		const seen = moved || playing ? steps : [step];
		pictures.want(
			seen.flatMap((k) => {
				const result = results.get(resultName(shownVersion(state), k, queryNow()));
				const maps = result ? mapNames(sequence.key, result, layers2d).flat() : [];
				return [
					...sequence.cameras.flatMap((camera, index) => {
						const name = pictureName(sequence.key, index, k);
						const other = nearest && pictures.get(name)?.missing ? [standIn(name)] : [];
						return camera.has_pictures ? [name, ...other] : [];
					}),
					...maps,
				];
			}),
		);
		const done = shownDone(state);
		const useful = steps.filter((k) => k === step || k < done);
		results.want(
			useful.slice(0, RESULTS_KEPT / 2).map((k) => resultName(shownVersion(state), k, queryNow())),
		);
	}

	/**
	 * @param {PageState} state
	 * @param {number} step
	 * @returns {Frame | null} null while something that will come is missing
	 */
	function assemble(state, step) {
		const { sequence } = state;
		if (!sequence) return null;
		const lost = state.link === "lost";
		const found = sequence.cameras.map((camera, index) => {
			if (!camera.has_pictures) return { bitmap: null, missing: null };
			const name = pictureName(sequence.key, index, step);
			const own = pictures.get(name);
			return own?.missing && state.nearest ? pictures.get(standIn(name)) : own;
		});
		if (!lost && found.some((picture) => picture === undefined)) return null;
		const result =
			results.get(resultName(shownVersion(state), step, queryNow())) ??
			(lost ? results.get(resultName(shownVersion(state), step, "")) : undefined);
		const names = result ? mapNames(sequence.key, result, state.layers2d) : [];
		const maps = names.map((list) => list.flatMap((name) => pictures.get(name) ?? []));
		if (!lost && maps.flat().length < names.flat().length) return null;
		const frame = { step, pictures: found, maps };
		const computing = state.run?.state === "computing";
		if (result?.computed) return { ...frame, result, stale: isOld(state, result.run) };
		// Until the new run comes to this step, the one before is faintly better than nothing.
		const before = state.result;
		if (computing && before?.computed && before.step === step && state.shown === step) {
			return { ...frame, result: before, stale: isOld(state, before.run) };
		}
		return result || lost ? { ...frame, result: result ?? null, stale: false } : null;
	}

	/** @param {number} now */
	function tick(now) {
		frameAsked = false;
		let state = store.get();
		const { sequence } = state;
		if (!sequence) return;
		if (state.playing && state.step === state.shown) {
			const [first, last] = playedRange(state.range, sequence.frames);
			const how = {
				fps: sequence.fps,
				speed: state.speed,
				direction: state.playing,
				first,
				last,
				loop: state.loop,
				realTime: state.realTime,
			};
			const next = advance({ step: state.step, rest }, lastTick ? (now - lastTick) / 1000 : 0, how);
			rest = next.rest;
			if (lastTick) wait = restOf3d(wait, now - lastTick, Math.max(1000 / 60, 1000 / sequence.fps));
			lastTick = now;
			if (next.step !== state.step) windowDirty = true;
			store.set({ step: next.step, playing: next.ended ? 0 : state.playing });
			state = store.get();
		}
		if (windowDirty) refreshWindow(state);
		if (state.step !== state.shown || dirty) {
			const frame = assemble(state, state.step);
			if (frame) {
				dirty = frame.stale;
				for (const paint of painters) paint(frame);
				store.set({ shown: state.step, result: frame.result });
			}
		}
		// Where it is drawn without a graphics card, 3D takes the time of pictures and overlays.
		if (state.step !== lastSent && (!state.playing || now - sentAt >= Math.max(wait, least))) {
			lastSent = state.step;
			sentAt = now;
			sendSeek(state.step);
		}
		if (state.playing) ask();
	}

	/** @type {number | null} */
	let keptBefore = null;
	store.on(["server", "run", "basis", "revision", "timeline"], (state) => {
		const kept = state.run?.kept ?? null;
		if (kept !== keptBefore) results.clear(); // the same run, with or without its stages
		keptBefore = kept;
		const done = shownDone(state);
		for (const name of [...results.names()]) {
			const result = results.get(name);
			if (result && !result.computed && (result.run !== state.basis || result.step < done))
				results.forget(name);
		}
		dirty = true;
		windowDirty = true;
		ask();
	});
	store.on(["nearest"], () => (dirty = true));
	store.on(["step", "playing", "moved", "speed", "layers2d", "link", "nearest"], () => {
		windowDirty = true;
		ask();
	});
	// Lanes, pictures and tables come first.
	store.on(["place", "basis"], () => (newsAt = performance.now()));
	store.on(["link"], () => {
		// A server that was started anew stands at its own first step.
		lastSent = -1;
	});
	store.on(["playing"], () => {
		lastTick = 0;
		rest = 0;
		// Where it stops, 3D is to stand at the same step.
		ask();
	});

	return {
		/**
		 * When the 3D view may draw again, having drawn at a time: the page's own clock, milliseconds.
		 * @param {number} last @param {number} cost  of that, until the browser was ready for more
		 */
		after3d(last, cost) {
			const { playing, step, shown } = store.get();
			least = slow ? restAfter3d(cost) : 0;
			if (playing) return last + Math.max(wait, least);
			// Pictures that are waited for come first.
			return slow ? Math.max(newsAt + LAST_3D, step === shown ? 0 : last + SLOW_3D) : 0;
		},
		/** It is drawn without a graphics card: it begins by being left alone. */
		slow3d() {
			slow = true;
			wait = SLOW_3D;
		},
		/** @param {(frame: Frame) => void} painter */
		onPaint(painter) {
			painters.push(painter);
		},
		/** Paint the shown step again: sizes, layers, selection or theme changed. */
		repaint() {
			dirty = true;
			ask();
		},
		/** A result that came by itself. @param {Server.Step} result */
		receive(result) {
			results.put(resultName(versionOf(result), result.step, ""), result);
			if (result.step === store.get().step) dirty = true;
			ask();
		},
		/** @param {number} step */
		seek(step) {
			const { frames } = store.get();
			if (frames > 0) store.set({ step: clampStep(step, frames), moved: true });
		},
		/** Another tab or the 3D view moved the playhead. @param {number} step */
		follow(step) {
			if (step === lastSent) return;
			lastSent = step;
			store.set({ step, playing: 0 });
		},
		/**
		 * Forget everything of the sequence before.
		 * @param {number} step  where the server stands in the new one
		 */
		clear(step) {
			pictures.clear();
			results.clear();
			lastSent = step;
			dirty = true;
			windowDirty = true;
			ask();
		},
		/** @returns {number[]} steps with the pictures of all cameras */
		loadedSteps() {
			const cameras = store.get().cameras.filter((camera) => camera.has_pictures).length;
			/** @type {Map<number, number>} */
			const counts = new Map();
			for (const name of pictures.names()) {
				if (!name.startsWith("/api/picture/")) continue;
				const step = parseInt(name.slice(name.lastIndexOf("/") + 1));
				counts.set(step, (counts.get(step) ?? 0) + 1);
			}
			return [...counts].filter(([, count]) => count === cameras).map(([step]) => step);
		},
	};
}
