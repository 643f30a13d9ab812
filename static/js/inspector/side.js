/** The side panel: tabs with a panel each, and the first of them, the table of tracks. */
import { claim, all, one, parts, fill, h, idTag, write } from "../elements/dom.js";
import { table } from "../elements/table.js";
import {
	isAlone,
	eventsNow,
	nextEvent,
	resultOf,
	scoresOf,
	stateAt,
	trueCount,
} from "../state/events.js";

/* ---------- Which tracks are listed: all, false ones, those with misses, those with the largest
   errors. */

/** Share of the tracks that count as the worst. */
const WORST = 0.2;

/**
 * The tracks of each kind; without truth nothing is false and no error known.
 * @param {Server.TrackLife[]} tracks
 * @param {Map<number, Server.ScoredTrackInfo>} scored  by id
 * @param {[number, number, string][]} events
 * @returns {Record<PageState["listed"], Server.TrackLife[]>}
 */
export function kindsOf(tracks, scored, events) {
	const missed = new Set(events.flatMap(([, id, kind]) => (kind === "long miss" ? [id] : [])));
	const error = (/** @type {Server.TrackLife} */ { id }) => scored.get(id)?.mean_error ?? -1;
	const known = tracks.filter((track) => error(track) >= 0).sort((a, b) => error(b) - error(a));
	return {
		all: tracks,
		false: tracks.filter(({ id }) => scored.get(id)?.kind === "false"),
		missed: tracks.filter(({ id }) => missed.has(id)),
		worst: known.slice(0, Math.ceil(WORST * known.length)),
	};
}

/** What each kind is called, and what it means. @type {[PageState["listed"], string, string][]} */
const KINDS = [
	["all", "all", "All tracks"],
	["false", "false", "Tracks that are nobody's by the truth"],
	["missed", "with misses", "Tracks that no camera saw for 1.5 s or longer"],
	["worst", "worst error", "The fifth of the tracks with the largest mean errors"],
];

/* ---------- The table of tracks: sorted by any column, walked by keyboard, alive at the shown
   step. */

/** Rows beyond this are counted, not drawn. */
const MOST_ROWS = 300;
const ORDER = { seen: 0, coasting: 1, lost: 2, "not yet": 3, ended: 4 };

/** @type {Pane} */
function mountTracks(root, { store, actions, playback }) {
	const { summary, upcoming, blank, listed } = parts(root);
	/** @type {Map<number, Server.ScoredTrackInfo>} */
	let scored = new Map();
	const step = () => Math.max(0, store.get().shown);
	const done = () => store.get().timeline?.done ?? 0;
	const state = (/** @type {Server.TrackLife} */ track) =>
		step() < done() ? stateAt(track, step()) : null;
	const ended = (/** @type {Server.TrackLife} */ track) => track.last < done() - 1;
	const duration = (/** @type {number} */ seconds) => `${seconds.toFixed(seconds < 1 ? 2 : 1)} s`;
	const here = (/** @type {Server.TrackLife} */ { id }) =>
		resultOf(store.get())?.tracks.find((track) => track.id === id);
	const cameras = (/** @type {Server.TrackLife} */ track) => {
		const now = here(track)?.seen ?? [];
		const list = (/** @type {boolean} */ seen) =>
			track.cameras
				.flatMap((share, k) => (share && Boolean(now[k]) === seen ? [k + 1] : []))
				.join(" ");
		return `${list(true)} ${list(false) && `(${list(false)})`}`.trim() || "–";
	};

	/** @type {Column<Server.TrackLife>[]} */
	const columns = [
		{
			word: "Id",
			cell: ({ id, name }) => [idTag(id), name && ` ${name}`],
			by: ({ id }) => id,
		},
		{
			word: "State",
			cell: (t) => state(t) ?? "–",
			by: (t) => ORDER[state(t) ?? "ended"],
			live: true,
		},
		{ word: "Born", kind: "num", cell: (t) => t.first, by: (t) => t.first },
		{
			word: "Died",
			kind: "num",
			cell: (t) => (ended(t) ? t.last : "–"),
			by: (t) => (ended(t) ? t.last : 1e9),
		},
		{
			word: "Length",
			kind: "num",
			cell: (t) => duration((t.last - t.first + 1) / store.get().fps),
			by: (t) => t.last - t.first,
		},
		{ word: "Seen", kind: "num", cell: (t) => `${Math.round(t.seen * 100)} %`, by: (t) => t.seen },
		{
			word: "Cameras",
			help: "That see it now, by number; in brackets those that saw it at other steps",
			cell: cameras,
			by: (t) => t.cameras.filter(Boolean).length,
			live: true,
		},
		{
			word: "Weight",
			kind: "num",
			cell: (t) => here(t)?.existence.toFixed(2) ?? "–",
			by: (t) => here(t)?.existence ?? -1,
			live: true,
		},
		{
			word: "x, y, z  m",
			kind: "num",
			cell: (t) =>
				here(t)
					?.position.map((v) => v.toFixed(2).replace("-", "−"))
					.join("  ") ?? "–",
			live: true,
		},
		{
			word: "Error  m",
			kind: "num truth",
			cell: ({ id }) => scored.get(id)?.mean_error?.toFixed(3) ?? "–",
			by: ({ id }) => scored.get(id)?.mean_error ?? 1e9,
		},
		{
			word: "Switches",
			kind: "num truth",
			cell: ({ id }) => scored.get(id)?.switches ?? "–",
			by: ({ id }) => scored.get(id)?.switches ?? -1,
		},
	];
	const rows = table("Tracks", columns, {
		key: ({ id }) => id,
		by: "Length",
		down: true,
		choose: ({ id }, event) =>
			event.altKey ? actions.solo(id) : actions.select(store.get().selection === id ? null : id),
		open: ({ id, first }) => {
			actions.select(id);
			playback.seek(first);
		},
		attributes: ({ id }) => ({
			onpointerenter: () => store.set({ hover: { id, camera: -1 } }),
			onpointerleave: () => store.set({ hover: null }),
		}),
	});
	const scroller = h("div.scroll", rows.element);
	root.prepend(scroller);
	const buttons = KINDS.map(([name, , tip]) =>
		h("button", { "data-tip": tip, onclick: () => store.set({ listed: name }) }),
	);
	fill(listed, buttons);

	function list() {
		const { timeline, sequence, run } = store.get();
		scored = new Map(scoresOf(store.get())?.evaluation.per_track.map((track) => [track.id, track]));
		scroller.classList.toggle("plain", !sequence?.has_truth);
		const kinds = kindsOf(timeline?.tracks ?? [], scored, timeline?.events ?? []);
		const { listed: kind } = store.get();
		const truth = sequence?.has_truth;
		buttons.forEach((button, k) => {
			const [name, word] = KINDS[k];
			button.hidden = !truth && (name === "false" || name === "worst");
			button.ariaPressed = String(name === kind);
			write(button, `${word} ${kinds[name].length}`);
		});
		const tracks = kinds[kind].filter(
			({ id }) => !isAlone(store.get()) || id === store.get().selection,
		);
		rows.show(tracks.slice(0, MOST_ROWS));
		blank.hidden = tracks.length > 0;
		if (!tracks.length) {
			const [title, text] = kinds.all.length
				? ["No such track", "All tracks are listed with the first of the buttons below."]
				: !sequence
					? ["Tracks appear here", "once a sequence is open."]
					: run?.state === "computing"
						? ["No track yet", "The run goes on; tracks appear as they are found."]
						: !run?.done && run?.state === "cancelled"
							? ["No track yet", "The run was stopped before its first step."]
							: [
									"No track was found",
									"Lower the extraction threshold, or look at the detections in the pictures: without boxes there is nothing to fuse.",
								];
			fill(blank, h("h3", title), h("p", text));
		}
		now();
	}

	/** What changes with the playhead: written only where it differs. */
	function now() {
		const { timeline, selection, sequence } = store.get();
		rows.live();
		rows.each((track, row) => {
			row.classList.toggle("gone", !["seen", "coasting"].includes(state(track) ?? ""));
			row.ariaSelected = String(track.id === selection);
		});
		const result = resultOf(store.get());
		const more =
			Math.max(0, (timeline?.tracks.length ?? 0) - MOST_ROWS) + (timeline?.left_out ?? 0);
		const of = sequence?.has_truth && result ? ` of ${trueCount(result)}` : "";
		const words = `${result?.tracks.length}${of} people at step ${step()}${more > 0 ? ` · ${more} more tracks` : ""}`;
		write(summary, result ? words : sequence ? "not computed at this step" : "");
		const events = eventsNow(store.get());
		const event = nextEvent(events, step(), 1);
		const alike = events.filter(({ kind }) => kind === event?.kind);
		fill(
			upcoming,
			event
				? [
						h("b", `${event.kind} of ${event.id}, step ${event.step}`),
						` · ${alike.indexOf(event) + 1} of ${alike.length}`,
					]
				: "no later event",
		);
	}

	store.watch(["timeline", "sequence", "run", "scores", "layers3d", "listed"], list);
	store.on(["shown", "result", "eventKind"], now);
	store.on(["selection"], () => (isAlone(store.get()) ? list() : now()));
	store.on(["selection"], ({ selection }) =>
		rows.each(({ id }, row) => id === selection && row.scrollIntoView({ block: "nearest" })),
	);
}

/** @type {Pane} */
export function mountSide(root, context) {
	const { store } = context;
	const { count, only, unsaved } = parts(root);
	const tabs = all("[role=tab]", root);
	const nameOf = (/** @type {Part} */ tab) =>
		/** @type {PageState["tab"]} */ (tab.id.replace("tab-", ""));
	for (const tab of tabs) {
		tab.addEventListener("click", () => store.set({ tab: nameOf(tab) }));
		tab.addEventListener("keydown", (event) => {
			const there = tabs.filter(({ hidden }) => !hidden);
			const [at, count] = [there.indexOf(tab), there.length];
			const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: -1 }[event.key];
			if (to === undefined) return;
			claim(event);
			const next = there[(to + count) % count];
			store.set({ tab: nameOf(next) });
			next.focus();
		});
	}
	mountTracks(one("#panel-tracks"), context);

	function choose() {
		const { tab: wanted, place } = store.get();
		for (const tab of tabs) {
			// What belongs to a place is there alone.
			if (nameOf(tab) === "place") tab.hidden = place !== "check";
			const chosen = nameOf(tab) === (wanted === "place" && place !== "check" ? "tracks" : wanted);
			tab.ariaSelected = String(chosen);
			tab.tabIndex = chosen ? 0 : -1;
			one(`#panel-${nameOf(tab)}`).hidden = !chosen;
		}
	}
	store.watch(["tab", "place"], choose);
	store.on(["layers3d", "selection"], (state) => {
		only.ariaPressed = String(isAlone(state));
		only.disabled = state.selection === null;
	});
	store.on(["server"], ({ server }) => {
		const changes = server?.changed.length ?? 0;
		count.hidden = changes === 0;
		count.textContent = String(changes);
		const drafts = server?.teaching.unsaved ?? 0;
		unsaved.hidden = drafts === 0;
		unsaved.textContent = String(drafts);
	});
}
