/** What can be said to put tracks right: one function for each command, at every place of the bench. */
import { resultOf } from "../state/events.js";
import { sendsFile } from "./export.js";
import { mountMarks } from "./marks.js";
import { mountMenu } from "./menu.js";
import { checkOf } from "./model.js";
import { distinct, filmSteps, isOfTwo, nextCrossing, otherOf, proposed } from "./words.js";

/** @param {Context} context @param {TimelineSeam} timeline */
export function mountCorrecting(context, timeline) {
	const { store, actions } = context;
	const check = checkOf(context);
	const { state } = check;
	const menu = mountMenu(context, timeline, { exchange, join, name });

	/** The alternative that was looked at last, and of which place. */
	let looked = { id: "", other: 0 };
	state.on(["other"], ({ chosen: doubt, other }) => {
		if (doubt && other) looked = { id: doubt.id, other };
	});

	/** The place that was looked at last; answered, it is no longer in the queue. @type {Doubt | null} */
	let seen = null;
	state.on(["chosen"], ({ chosen: doubt }) => (seen = doubt ?? seen));
	store.on(["sequence"], () => (seen = null));

	const shown = () => store.get().step;
	const chosen = () => (store.get().place === "check" ? state.get().chosen : null);

	/** A place, the chosen one if none is given, where the playhead is at it. */
	function here(doubt = chosen()) {
		if (!doubt) return null;
		const film = filmSteps(doubt.first, doubt.last, store.get());
		return shown() >= film[0] && shown() <= film[film.length - 1] ? doubt : null;
	}

	/** Who is meant: the selected one, else the first of the chosen place. */
	function who() {
		const id = store.get().selection ?? chosen()?.tracks[0] ?? null;
		if (id === null)
			actions.note(
				"info",
				"Which track?",
				"Click a lane, a box or a person in 3D; [ and ] walk through them.",
			);
		return id;
	}

	/** The alternative of the place here with a word; 0 where there is none. @param {RegExp} word */
	function alternative(word) {
		const doubt = here();
		const { selection } = store.get();
		if (!doubt || (selection !== null && !doubt.tracks.includes(selection))) return 0;
		return Math.max(
			0,
			doubt.alternatives.findIndex(({ words, as_it_is: same }) => !same && word.test(words)),
		);
	}

	/** @param {Wish} wish @param {string} words  of what was done */
	async function say(wish, words) {
		if (!(await check.say([wish])) || store.get().place === "check") return;
		actions.note("info", words, "It holds after every change of parameters.", {
			word: "Undo",
			act: () => void check.undo("undo"),
		});
	}

	/** @param {number} one @param {number} other */
	function exchange(one, other, step = shown()) {
		return say(
			{ kind: "exchanged", step, tracks: [one, other] },
			`Tracks ${one} and ${other} exchanged from step ${step} on`,
		);
	}

	/** @param {number} one @param {number} other */
	function join(one, other) {
		const { timeline: lanes } = store.get();
		const lives = [one, other].map((id) => lanes?.tracks.find((track) => track.id === id));
		const [a, b] = lives;
		// Of two that are there at once it is said from when on.
		const both = a && b && Math.max(a.first, b.first) <= Math.min(a.last, b.last);
		return say(
			{ kind: "same", tracks: [one, other], ...(both && { step: shown() }) },
			`Tracks ${one} and ${other} are one person`,
		);
	}

	/** @param {number} track @param {string} name */
	function name(track, name) {
		return say({ kind: "name", step: shown(), tracks: [track], name }, `Track ${track} is ${name}`);
	}

	/** An exchange whose ends somebody changed, else the answer of the queue. @param {number} which */
	function answer(which) {
		const { ends } = state.get();
		const doubt = chosen();
		if (!doubt) return;
		const [one, other] = doubt.tracks;
		if (!which || !ends || !isOfTwo(doubt)) return check.answer(which);
		return check.say([
			{
				kind: "exchanged",
				step: ends[0],
				tracks: [one, other],
				...(ends[1] !== null && { to: ends[1] + 1 }),
			},
		]);
	}

	/** @param {-1 | 1} direction */
	function turn(direction) {
		const { queue, chosen: now } = state.get();
		const doubts = queue?.doubts ?? [];
		location.hash = "#check";
		if (!doubts.length) return;
		const index = doubts.findIndex(({ id }) => id === now?.id);
		check.choose(
			doubts[
				index < 0
					? direction > 0
						? 0
						: doubts.length - 1
					: (index + direction + doubts.length) % doubts.length
			],
		);
	}

	/** What one track says of itself here. @param {"came" | "left" | "nobody" | "different"} kind @param {string} words */
	function alone(kind, words) {
		const track = who();
		if (track === null) return;
		const step = kind === "nobody" ? {} : { step: shown() };
		return say({ kind, tracks: [track], ...step }, `Track ${track} ${words}`);
	}

	/** @type {Record<Correcting, () => void | Promise<any>>} */
	const EDITS = {
		next: () => turn(1),
		previous: () => turn(-1),
		crossing() {
			const doubt = nextCrossing(state.get().queue?.doubts ?? [], store.get().step);
			if (doubt) check.choose(doubt);
			else actions.note("info", "No two people come close", "None that is in doubt, that is.");
		},
		other() {
			const doubt = chosen();
			if (!doubt) return;
			const last = looked.id === doubt.id ? looked.other : otherOf(doubt);
			check.show(state.get().other ? 0 : last);
		},
		alternative() {
			const doubt = chosen();
			if (!doubt) return;
			const { other } = state.get();
			const all = distinct(doubt, other).map(([, k]) => k);
			check.show(all[(all.indexOf(other) + 1) % all.length]);
		},
		confirm: () => answer(0),
		apply() {
			const doubt = chosen();
			if (doubt) return answer(state.get().other || proposed(doubt));
		},
		skip: () => check.skip(),
		exchange() {
			const doubt = here();
			const which = alternative(/^exchanged/) || (doubt && state.get().ends ? otherOf(doubt) : 0);
			if (which) return answer(which);
			const track = who();
			if (track === null) return;
			const other = doubt && isOfTwo(doubt) && doubt.tracks.find((id) => id !== track);
			if (other && doubt.tracks.includes(track)) return exchange(track, other);
			menu.others("exchange", track);
		},
		split() {
			const which = alternative(/^two people/);
			return which ? answer(which) : alone("different", `is two people, cut at step ${shown()}`);
		},
		join() {
			const doubt = here();
			const which = alternative(/goes on/);
			const best = doubt && (state.get().other || proposed(doubt));
			// Where the place proposes it; what is hardly likely there is nobody's word for it.
			if (which && doubt?.kind === "join") return answer(which);
			if (which && best && /goes on/.test(doubt.alternatives[best].words)) return answer(best);
			const track = who();
			if (track !== null) menu.others("join", track);
		},
		nobody() {
			const which = alternative(/^nobody/);
			return which ? answer(which) : alone("nobody", "was nobody");
		},
		here() {
			const { selection, playing } = store.get();
			if (playing) store.set({ playing: 0 });
			const track = resultOf(store.get())?.tracks.some(({ id }) => id === selection)
				? selection
				: null;
			location.hash = "#check";
			actions.showTab("place");
			state.set({ placing: { track, step: shown(), clicks: [] } });
		},
		came: () => alone("came", `came in at step ${shown()}`),
		left: () => alone("left", `left at step ${shown()}`),
		name() {
			const track = who();
			if (track !== null) menu.name(track);
		},
		checked() {
			const { range, loop, frames } = store.get();
			const doubt = chosen() ?? here(seen);
			const [first, last] = loop
				? [range[0] ?? 0, range[1] ?? frames - 1]
				: doubt
					? [doubt.first, doubt.last]
					: [shown(), shown()];
			return say({ kind: "checked", first, last }, `Steps ${first} to ${last} are checked`);
		},
		menu() {
			const track = who();
			if (track !== null) menu.open({ track, step: shown() });
		},
		undo: () => check.undo("undo"),
		redo: () => check.undo("redo"),
		truth: () => sendsFile(actions, "/api/corrections/truth.csv", "ground_truth.csv"),
	};
	actions.correct = (what) => EDITS[what]();
	mountMarks(context, timeline, check);
}
