/** What is doubtful and what was put right, fetched and kept; every part of Check looks at this. */
import { ApiError, fetcher, getJson, sendCommand, sendJson } from "../state/api.js";
import { createStore } from "../state/store.js";
import { isLike, middleOf } from "./words.js";

/** One for a page. @type {WeakMap<Store<PageState>, Check>} */
const made = new WeakMap();

/** @param {Context} context @returns {Check} */
export function checkOf(context) {
	const { store } = context;
	const check = made.get(store) ?? createCheck(context);
	made.set(store, check);
	return check;
}

/** While a run goes on its places are asked for at most so often, milliseconds. */
const OFTEN = 1500;

/** @param {Context} context @returns {Check} */
function createCheck({ store, actions, playback }) {
	/** @type {CheckState} */
	const empty = {
		told: null,
		queue: null,
		chosen: null,
		other: 0,
		preview: null,
		ends: null,
		placing: null,
	};
	const state = createStore(empty);
	/** Where the chosen place stood, so that the next one is there when it is done. */
	let at = 0;
	let answered = false;
	let placed = false;
	/** Places that were answered, and the run whose they are: its queue still has them. */
	/** @type {Map<string, string | null>} */
	const gone = new Map();
	let asked = 0;

	const refresh = fetcher(async () => {
		const { sequence, run } = store.get();
		if (!sequence) return;
		asked = performance.now();
		const told = await getJson("/api/corrections");
		state.set({ told });
		// In Tune the run has the machine for itself; the queue is asked for when it is done.
		if (!run?.done || (run.state === "computing" && store.get().place !== "check")) return;
		receiveQueue(await getJson("/api/corrections/queue"));
	});

	/** @param {Server.DoubtQueue} told */
	function receiveQueue(told) {
		const { chosen, placing } = state.get();
		const doubts = told.doubts.filter(({ id }) => gone.get(id) !== told.run || !gone.has(id));
		const queue = { ...told, doubts };
		const same =
			doubts.find(({ id }) => id === chosen?.id) ?? doubts.find((one) => isLike(one, chosen));
		state.set({ queue });
		store.set({
			signs: { ...store.get().signs, check: doubts.length ? String(doubts.length) : "" },
		});
		if (same) {
			at = doubts.indexOf(same);
			state.set({ chosen: same });
		} else if (answered || (chosen && queue.complete && store.get().run?.state === "done")) {
			// What is done makes room for the next; while a run goes on the shown one stays. Who has
			// sought elsewhere meanwhile is not called back, nor who is placing people.
			const { place, step } = store.get();
			const elsewhere = chosen && (step < chosen.first || step > chosen.last);
			const away = placing || (!answered && (placed || elsewhere));
			answered = placed = false;
			const next = doubts[Math.min(at, doubts.length - 1)] ?? null;
			if (place === "check" && !away) choose(next);
			else state.set({ ...hide(), chosen: null, placing });
		}
	}

	/** How it would be is drawn no more. */
	function hide() {
		// Where nothing is drawn any more there is nothing to tell either.
		if (state.get().other)
			sendJson("POST", "/api/corrections/ghosts", { doubt: null }).catch(() => {});
		return { other: 0, preview: null, ends: null, placing: null };
	}

	/** @param {Doubt | null} doubt */
	function choose(doubt) {
		at = Math.max(0, state.get().queue?.doubts.findIndex(({ id }) => id === doubt?.id) ?? 0);
		state.set({ ...hide(), chosen: doubt });
		if (!doubt) return;
		store.set({ playing: 0 });
		playback.seek(middleOf(doubt));
		actions.select(doubt.tracks[0] ?? null);
	}

	/** @param {number} other */
	async function show(other) {
		const { chosen, ends } = state.get();
		if (!chosen?.alternatives[other]) return;
		if (!other) return state.set({ ...hide(), ends });
		state.set({ other });
		const preview = await ofPlace(
			sendJson("POST", "/api/corrections/ghosts", { doubt: chosen.id, alternative: other }),
		);
		const now = state.get();
		if (now.chosen?.id === chosen.id && now.other === other) state.set({ preview });
	}

	/**
	 * Ask something of the chosen place. A run that came meanwhile may not have it any more: then
	 * the queue is read anew, and nobody did anything wrong.
	 * @param {Promise<any>} asked
	 */
	async function ofPlace(asked) {
		try {
			const answer = await asked;
			actions.accepted("corrections");
			return answer ?? true;
		} catch (error) {
			if (!(error instanceof ApiError)) throw error;
			if (error.code !== "no_doubt") actions.refused(error, "corrections");
			else actions.note("info", "This place has changed", "The run is another by now: look again.");
			state.set({ ...hide(), ends: state.get().ends });
			void refresh();
			return null;
		}
	}

	/** Read anew what was changed. @param {boolean | null} taken  null where it was refused */
	function changed(taken) {
		if (!taken) return false;
		state.set(hide());
		void refresh();
		return true;
	}

	state.on(["told"], ({ told }) => store.set({ names: told?.names ?? {} }));
	/** @type {Timer} */
	let waiting;
	/** What follows one another at once is asked about once. @param {number} rest  milliseconds */
	function soon(rest) {
		clearTimeout(waiting);
		waiting = setTimeout(() => void refresh(), Math.max(0, rest));
	}
	let [heard, count] = ["", 0];
	store.watch(["sequence"], () => {
		state.set(empty);
		store.set({ signs: { ...store.get().signs, check: "" } });
		// Of a copy, in which the page goes on, lanes and corrections are as they were.
		if (store.get().timeline) soon(100);
	});
	// Lanes of another run come first: who opens one waits for them.
	store.on(["server", "timeline"], ({ server, timeline }) => {
		const now = `${server?.corrections?.key} ${timeline?.run}`;
		if (!timeline || now === heard) return;
		heard = now;
		// What is said no more is doubtful again.
		const corrections = server?.corrections.count ?? 0;
		if (corrections < count) gone.clear();
		count = corrections;
		soon(100);
	});
	store.on(["place"], ({ place }) => place === "check" && void refresh());
	let ended = "";
	store.watch(["run"], ({ run }) => {
		const now = `${run?.key} ${run?.state}`;
		if (!run || (now === ended && run.state !== "computing")) return;
		// In Tune nobody looks at what a run under way leaves open.
		if (run.state === "computing" && store.get().place !== "check") return;
		ended = now;
		// Lanes that are still on their way have it asked when they are here.
		if (!store.get().timeline) return;
		soon(run.state === "computing" ? OFTEN - (performance.now() - asked) : 100);
	});

	return {
		state,
		choose,
		show: (other) => void show(other),
		async say(corrections) {
			placed = corrections.some(({ kind }) => kind === "here");
			return changed(await actions.command("correct", { corrections }));
		},
		async answer(alternative) {
			const { chosen } = state.get();
			if (!chosen) return false;
			answered = true;
			const { queue } = state.get();
			const wish = { doubt: chosen.id, alternative };
			const taken = changed(await ofPlace(sendCommand("answer", wish)));
			answered &&= taken;
			if (taken && queue) {
				gone.set(chosen.id, queue.run);
				receiveQueue({ ...queue, answered: queue.answered + 1 });
			}
			return taken;
		},
		async skip() {
			const { chosen, queue } = state.get();
			if (!chosen || !queue) return;
			answered = true;
			if (await actions.command("skip", { doubt: chosen.id })) {
				gone.set(chosen.id, queue.run);
				receiveQueue(queue);
			} else answered = false;
		},
		drop: async (id) => changed(await actions.command("drop_correction", { id })),
	};
}
