// @ts-check
/** The table of tracks: sorted by any column, walked by keyboard, alive at the shown step. */
import { fill, h, icon, idTag, tipOf, write } from "../dom.js";
import { eventsNow, nextEvent, scoresOf, stateAt } from "../events.js";

/** Rows beyond this are counted, not drawn. */
const MOST_ROWS = 300;
const ORDER = { seen: 0, coasting: 1, lost: 2, "not yet": 3, ended: 4 };

/** @type {TrackColumn[]} */
const COLUMNS = [
	{ name: "id", word: "Id", number: false, give: "", value: (t) => t.id },
	{ name: "state", word: "State", number: false, give: "", value: (t, { step }) => ORDER[stateAt(t, step)] },
	{ name: "born", word: "Born", number: true, give: "", value: (t) => t.first },
	{ name: "died", word: "Died", number: true, give: "", value: (t, { done }) => (t.last < done - 1 ? t.last : Infinity) },
	{ name: "length", word: "Length", number: true, give: "", value: (t) => t.last - t.first },
	{ name: "seen", word: "Seen", number: true, give: "", value: (t) => t.seen },
	{ name: "existence", word: "Weight", number: true, give: "", value: (t) => t.id },
	{ name: "position", word: "x, y, z  m", number: true, give: "opt-1", value: (t) => t.id },
	{ name: "error", word: "Error  m", number: true, give: "truth", value: (t, { scored }) => scored.get(t.id)?.mean_error ?? Infinity },
	{ name: "switches", word: "Switches", number: true, give: "truth", value: (t, { scored }) => scored.get(t.id)?.switches ?? -1 },
];

/** @param {number} seconds */
const duration = (seconds) => `${seconds.toFixed(seconds < 1 ? 2 : 1)} s`;

/** @param {HTMLElement} root @param {Context} context */
export function mountTracks(root, { store, page, actions, playback }) {
	let sortBy = "length";
	let downward = true;
	/** @type {Map<number, TrackRow>} */
	const rows = new Map();
	const heads = COLUMNS.map((column) =>
		h(
			"th",
			{ scope: "col", class: `${column.number ? "num" : ""} ${column.give}` },
			column.name === "existence" || column.name === "position"
				? column.word
				: h("button", { onclick: () => sort(column.name) }, column.word),
		),
	);
	const body = h("tbody", {});
	const scroll = h("div", { class: "scroll" }, h("table", { "aria-label": "Tracks" }, h("thead", {}, h("tr", {}, heads)), body));
	const nothing = h("div", { class: "blank", hidden: true });
	const summary = h("span", {});
	const upcoming = h("span", { class: "opt-1" });
	const foot = h(
		"div",
		{ class: "foot tall" },
		summary,
		h("span", { class: "grow" }),
		upcoming,
		h("button", { class: "btn icon up end", "aria-label": "Previous event", ...tipOf("previous-event", "Previous event"), onclick: () => actions.toEvent(-1) }, icon("i-prev", "s")),
		h("button", { class: "btn icon up end", "aria-label": "Next event", ...tipOf("next-event", "Next event"), onclick: () => actions.toEvent(1) }, icon("i-next", "s")),
	);
	root.append(scroll, foot, nothing);
	nothing.style.top = "0";

	/** @param {string} name */
	function sort(name) {
		downward = sortBy === name ? !downward : false;
		sortBy = name;
		list();
	}

	/** @param {TrackLane} track */
	function makeRow(track) {
		const cells = COLUMNS.map((column) => h("td", { class: `${column.number ? "num" : ""} ${column.give}` }));
		cells[0].append(idTag(track.id));
		const row = h(
			"tr",
			{
				tabindex: 0,
				onclick: () => page.select(store.get().selection === track.id ? null : track.id),
				ondblclick: () => {
					page.select(track.id);
					playback.seek(track.first);
				},
				onkeydown: (/** @type {KeyboardEvent} */ event) => {
					if (event.key === "Enter") page.select(track.id);
					const next = event.key === "ArrowDown" ? row.nextElementSibling : event.key === "ArrowUp" ? row.previousElementSibling : null;
					if (next instanceof HTMLElement) {
						event.preventDefault();
						next.focus();
					}
				},
				onpointerenter: () => store.set({ hover: { id: track.id, camera: -1 } }),
				onpointerleave: () => store.set({ hover: null }),
			},
			cells,
		);
		return { row, cells };
	}

	function list() {
		const { timeline, server, run, shown } = store.get();
		const fps = server?.sequence?.fps ?? 25;
		const done = timeline?.done ?? 0;
		const scored = new Map(scoresOf(store.get())?.evaluation.per_track.map((track) => [track.id, track]));
		scroll.classList.toggle("plain", !server?.sequence?.has_truth);
		const column = COLUMNS.find((c) => c.name === sortBy) ?? COLUMNS[0];
		const key = (/** @type {TrackLane} */ track) => Number(column.value(track, { step: Math.max(0, shown), done, scored }));
		const tracks = [...(timeline?.tracks ?? [])].sort((a, b) => (key(a) - key(b) || a.id - b.id) * (downward ? -1 : 1));
		const drawn = tracks.slice(0, MOST_ROWS);
		const ids = new Set(drawn.map((track) => track.id));
		for (const [id, { row }] of rows) {
			if (!ids.has(id)) {
				row.remove();
				rows.delete(id);
			}
		}
		drawn.forEach((track, index) => {
			let entry = rows.get(track.id);
			if (!entry) rows.set(track.id, (entry = makeRow(track)));
			const ended = track.last < done - 1;
			const score = scored.get(track.id);
			const texts = [null, null, track.first, ended ? track.last : "–", duration((track.last - track.first + 1) / fps), `${Math.round(track.seen * 100)} %`, null, null, score?.mean_error?.toFixed(3) ?? "–", score?.switches ?? "–"];
			texts.forEach((text, k) => text !== null && entry && write(entry.cells[k], String(text)));
			if (body.children[index] !== entry.row) body.insertBefore(entry.row, body.children[index] ?? null);
		});
		heads.forEach((head, index) => {
			if (COLUMNS[index].name === sortBy) head.setAttribute("aria-sort", downward ? "descending" : "ascending");
			else head.removeAttribute("aria-sort");
		});
		const empty = tracks.length === 0;
		nothing.hidden = !empty;
		if (empty) {
			const words = !server?.sequence
				? ["Tracks appear here", "once a sequence is open."]
				: run?.state === "computing"
					? ["No track yet", "The run goes on; tracks appear as they are found."]
					: ["No track was found", "Lower the extraction threshold, or look at the peaks in the pictures: without boxes there is nothing to fuse."];
			fill(nothing, h("h3", {}, words[0]), h("p", {}, words[1]));
		}
		now();
	}

	/** What changes with the playhead: written only where it differs. */
	function now() {
		const { timeline, result, basis, shown, selection, server } = store.get();
		const step = Math.max(0, shown);
		const current = result && result.run === basis ? result : null;
		const whole = new Map(current?.tracks.map((track) => [track.id, track]));
		for (const track of timeline?.tracks ?? []) {
			const entry = rows.get(track.id);
			if (!entry) continue;
			const state = step < (timeline?.done ?? 0) ? stateAt(track, step) : "–";
			const alive = state === "seen" || state === "coasting";
			write(entry.cells[1], state);
			const here = whole.get(track.id);
			write(entry.cells[6], here ? here.existence.toFixed(2) : "–");
			write(entry.cells[7], here ? here.position.map((v) => v.toFixed(2).replace("-", "−")).join("  ") : "–");
			entry.row.classList.toggle("gone", !alive);
			entry.row.setAttribute("aria-selected", String(track.id === selection));
		}
		const count = current?.computed ? current.tracks.length : undefined;
		const hidden = (timeline?.tracks.length ?? 0) - rows.size + (timeline?.left_out ?? 0);
		const truth = server?.sequence?.has_truth ? current?.truth.length : undefined;
		write(
			summary,
			count === undefined
				? server?.sequence ? "not computed at this step" : ""
				: `${count}${truth === undefined ? "" : ` of ${truth}`} people at step ${step}${hidden > 0 ? ` · ${hidden} more tracks` : ""}`,
		);
		const event = nextEvent(eventsNow(store.get()), step, 1);
		fill(upcoming, event ? ["next: ", h("b", {}, `${event.kind} of ${event.id}, step ${event.step}`)] : "no later event");
	}

	store.on(["timeline", "server", "scores"], list);
	store.on(["shown", "result", "selection"], now);
	store.on(["selection"], ({ selection }) => {
		if (selection !== null) rows.get(selection)?.row.scrollIntoView({ block: "nearest" });
	});
	list();
}
