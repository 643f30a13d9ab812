/** The place Library: recordings, the runs of one, and one run in small. */
import { claim, capture, all, fill, h, icon, write } from "../elements/dom.js";
import { asks, chooser, grow, paneHead } from "../elements/drawn.js";
import { ApiError, getJson, sendJson } from "../state/api.js";
import { chosenBar } from "./chosen.js";
import { preview } from "./preview.js";
import { runsTable } from "./runs.js";
import { factsOf, has, many, size, titleOf, when, whereabouts } from "./words.js";

/* ---------- A recording whose folder is gone: its runs stay readable, and somebody may say
   where it is now. */

/**
 * @param {(recording: Server.RecordingInfo) => void} moved
 */
function lostRecording(moved) {
	/** @type {Server.RecordingInfo | null} */
	let now = null;
	const why = h("span");
	const refused = h("p", { role: "alert", hidden: true });
	const place = h("input.field", {
		placeholder: "folder where it lies now",
		"aria-label": "Folder where the recording lies now",
		onkeydown: (/** @type {KeyboardEvent} */ event) => event.key === "Enter" && void find(),
	});
	const element = h(
		"div.lost",
		{ role: "status", hidden: true },
		why,
		place,
		h("button.btn.box", { onclick: () => void find() }, "Find…"),
		refused,
	);

	/** Where somebody looks who has just pressed the button. @param {string} words */
	function complain(words) {
		write(refused, words);
		refused.hidden = !words;
	}

	async function find() {
		if (!now || now.id === null) return;
		if (!place.value.trim()) return place.focus();
		const of = now.id;
		try {
			const body = { place: place.value.trim() };
			const answer = await sendJson("POST", `/api/library/recordings/${of}/place`, body);
			place.value = "";
			complain("");
			moved(answer);
		} catch (error) {
			if (!(error instanceof ApiError)) throw error;
			if (now?.id === of) complain(error.message);
		}
	}

	return {
		element,
		/** @param {Server.RecordingInfo | null} recording */
		show(recording) {
			if (recording?.id !== now?.id) complain("");
			now = recording;
			element.hidden = !recording?.missing || recording.id === null;
			write(why, `Its runs stay readable, but ${recording?.missing}.`);
		},
	};
}

/* ---------- The recordings of the library, own and rendered ones, as a list to choose from. */

const KINDS = /** @type {const} */ ([
	["Own", "folder"],
	["Built-in rooms", "rendered"],
]);

/** What recordings are sorted by; as they come they are by when they were opened. */
/** @type {Record<string, (a: Server.RecordingInfo, b: Server.RecordingInfo) => number>} */
const ORDERS = {
	"last opened": () => 0,
	name: (a, b) => a.name.localeCompare(b.name, undefined, { numeric: true }),
	"most runs": (a, b) => b.runs - a.runs,
	longest: (a, b) => b.frames - a.frames,
};

/** Its own, once it was opened; else one of the list of what can be opened, if it has any. */
/** @param {Server.RecordingInfo} one */
function picture(one) {
	const kept = one.id !== null;
	if (one.boxes_only) return icon("i-boxes", "l");
	if (one.missing || (kept && !one.has_thumbnail)) return icon("i-folder");
	const src = kept
		? `/api/library/thumbnail/${one.id}.jpg`
		: `/api/recordings/picture?name=${encodeURIComponent(one.name)}`;
	const image = h("img", { src, alt: "", loading: "lazy" });
	image.onerror = () => image.replaceWith(icon("i-folder"));
	return image;
}

/**
 * @param {object} on
 * @param {(recording: Server.RecordingInfo) => void} on.choose
 * @param {(recording: Server.RecordingInfo) => void} on.open
 * @param {() => void} on.add  another recording is wanted
 * @param {() => void} on.find
 */
function shelf(on) {
	const find = h("input", {
		type: "search",
		placeholder: "find",
		title: "A recording, a run or a note",
		"aria-label": "Find",
		oninput: () => on.find(),
		// Escape empties it without an input.
		onchange: () => on.find(),
	});
	const orders = Object.keys(ORDERS).map((word) => [word, word]);
	const order = chooser("Sort recordings by", orders, orders[0][0], on.find);
	const list = h("div.scroll.list", { role: "listbox", "aria-label": "Recordings" });
	const foot = h("div.foot");
	const element = h(
		"section.pane",
		{ "aria-label": "Recordings" },
		paneHead(
			"Recordings",
			grow(),
			h("button.btn", { "data-key": "Ctrl O", onclick: on.add }, "Open…"),
		),
		h("div.lib-find", icon("i-search", "s"), find, order),
		list,
		foot,
	);

	/** @param {Server.RecordingInfo} one @param {boolean} chosen @param {string} [where] */
	const item = (one, chosen, where) =>
		h(
			"button",
			{
				class: `item${one.missing ? " bad" : ""}`,
				role: "option",
				"aria-selected": String(chosen),
				tabindex: chosen ? 0 : -1,
				title: one.place,
				onclick: () => on.choose(one),
				ondblclick: () => on.open(one),
			},
			h("span.th", picture(one)),
			h(
				"span.tx",
				h("b", one.name),
				where && h("span.small.where", where),
				h("span", { class: `small${one.missing ? " missing" : ""}` }, factsOf(one)),
			),
			h("span.en", h("b", one.runs || ""), h("span.small", one.opened ? when(one.opened) : "")),
		);

	return {
		element,
		/** Where somebody writes what is sought. */
		find,
		/** What is sought. */
		text: () => find.value.trim(),
		reveal: () =>
			list.querySelector('[aria-selected="true"]')?.scrollIntoView({ block: "nearest" }),
		/** Where the chosen one is not what is sought, the first that is takes its place. */
		follow() {
			if (!list.querySelector('[aria-selected="true"]')) list.querySelector("button")?.click();
		},
		/**
		 * From one to the next by an arrow; whether the key was one of the list's.
		 * @param {KeyboardEvent} event
		 */
		walk({ key, target }) {
			const from = /** @type {HTMLElement} */ (target);
			if (!list.contains(from) || !["ArrowDown", "ArrowUp"].includes(key)) return false;
			const items = [...list.querySelectorAll("button")];
			const next = items[items.indexOf(/** @type {any} */ (from)) + (key === "ArrowDown" ? 1 : -1)];
			next?.focus();
			next?.click();
			return true;
		},
		/**
		 * @param {Server.LibraryInfo} library
		 * @param {Server.RecordingInfo | null} recording  whose runs are listed
		 * @param {boolean} [held]  it stays though its name is not what is sought: a run of it is
		 */
		show(library, recording, held = true) {
			const text = this.text();
			const walked = list.contains(document.activeElement);
			const where = whereabouts(library.recordings);
			fill(
				list,
				KINDS.flatMap(([word, kind]) => {
					const found = library.recordings
						.toSorted(ORDERS[order.value] ?? (() => 0))
						.filter(
							(one) =>
								one.kind === kind &&
								(!text ||
									has(text, [one.name, one.place]) ||
									(held && one.place === recording?.place)),
						);
					const head = h("div.cap", h("span", word), h("span", "runs"));
					const items = found.map((one) =>
						item(one, one.place === recording?.place, where.get(one.place)),
					);
					return found.length ? [head, ...items] : [];
				}),
			);
			// The items are new: who walks through them by arrows goes on from the chosen one.
			if (walked)
				/** @type {HTMLElement | null} */ (list.querySelector('[aria-selected="true"]'))?.focus();
			const kept = library.recordings.reduce((sum, one) => sum + one.runs, 0);
			fill(
				foot,
				library.error ??
					`${many(kept, "run")} · ${size(library.bytes)}${library.read_only ? " · read only" : ""}`,
			);
			foot.title = library.file;
		},
	};
}

/** A run that has just ended is kept a moment later. */
const KEPT_MS = 1500;

/** @type {Pane} */
export function mountLibrary(root, { store, actions }) {
	/** @type {Server.LibraryInfo | null} */
	let library = null;
	/** @type {Server.RecordingInfo | null} whose runs are listed */
	let recording = null;
	/** @type {Server.KeptRunInfo[]} */
	let runs = [];
	/** @type {Set<number>} */
	const chosen = new Set();
	/** @type {number | null} */
	let focused = null;
	/** The last reading, under way or over. */
	let refreshing = Promise.resolve();
	let starred = false;
	let writing = false;

	const recordings = shelf({
		choose: (one) => void choose(one),
		open: openRecording,
		add: () => actions.openSheet(),
		find: () => (show(), recordings.follow()),
	});
	const small = preview({ store, actions }, (run, note) => void change(run, { note }));
	const bar = chosenBar({
		store,
		actions,
		chosen: () => runs.filter(({ id }) => chosen.has(id)),
		none: chooseNone,
		leave,
	});
	const title = h("h2.pane-title", "Runs");
	const sub = h("span.sub");
	const only = h(
		"button.btn",
		{ "aria-pressed": "false", onclick: () => ((starred = !starred), show()) },
		icon("i-star", "s"),
		"starred",
	);
	const table = runsTable({
		focus: (run) => void focus(run.id),
		open: (run) => void small.open(run),
		star: (run) => void change(run, { star: !run.star }),
		tick: (run) => tick(run.id),
	});
	const empty = h("div.blank", { hidden: true });
	const gone = lostRecording((told) => {
		recording = told;
		void refresh();
	});
	fill(
		root,
		recordings.element,
		h(
			"section.pane.runs",
			{ "aria-label": "Runs" },
			paneHead(title, sub, grow(), only, table.chooser),
			gone.element,
			table.element,
			empty,
			bar.element,
		),
		small.element,
	);

	const focusedRun = () => runs.find(({ id }) => id === focused) ?? null;

	function chooseNone() {
		chosen.clear();
		show();
	}

	/** Those that are neither of another name nor without a star, where that is asked for. */
	function listed() {
		const text = recordings.text();
		return runs.filter(
			(run) =>
				(!starred || run.star) &&
				(!text ||
					has(text, [recording?.name ?? "", titleOf(run), run.note, ...run.tags, run.single_view])),
		);
	}

	function show() {
		// Who is writing a name goes on; what is news by then is drawn after it.
		if (!library || writing) return;
		const matching = listed();
		recordings.show(library, recording, matching.length > 0);
		fill(title, recording ? `Runs of ${recording.name}` : "Runs");
		fill(
			sub,
			recording?.people
				? `${runs.length} · truth of ${many(recording.people, "person").replace("persons", "people")}`
				: String(runs.length || ""),
		);
		only.ariaPressed = String(starred);
		table.element.hidden = !matching.length;
		empty.hidden = Boolean(matching.length);
		if (recording)
			fill(
				empty,
				h(
					"h3",
					runs.length
						? "No run matches"
						: library.error
							? "No runs are kept here"
							: isUnderWay()
								? "A run is under way"
								: "Nothing kept yet",
				),
				h("p", library.error ?? "Every run is kept here a few seconds after its end."),
				// The one that is open is only a tab away.
				recording.place !== store.get().sequence?.opened_as &&
					h(
						"button.btn.main",
						{ onclick: () => recording && openRecording(recording) },
						`Open ${recording.name}`,
					),
			);
		table.show(matching, chosen, focused, recording);
		gone.show(recording);
		bar.show();
	}

	/** Whether a run of the recording that is looked at is being computed. */
	function isUnderWay() {
		const { sequence, run } = store.get();
		return recording?.place === sequence?.opened_as && run?.state === "computing";
	}

	/** @param {Server.RecordingInfo} one */
	function openRecording(one) {
		void actions.open(one.place);
		location.hash = "#tune";
	}

	/** One after the other: of two at once the earlier would end before what it shows is there. */
	function refresh() {
		return (refreshing = refreshing.catch(() => {}).then(readAgain));
	}

	async function readAgain() {
		library = /** @type {Server.LibraryInfo} */ (await getJson("/api/library"));
		const { sequence } = store.get();
		const same = (/** @type {Server.RecordingInfo} */ one) =>
			[one.place, one.name].includes(recording?.place ?? sequence?.opened_as ?? "");
		const found = library.recordings.find(same) ?? library.recordings[0] ?? null;
		// The runs come with an answer of their own.
		if (!writing) recordings.show(library, found);
		await choose(found, true);
	}

	/** @param {Server.RecordingInfo | null} one @param {boolean} [again] keep what is chosen */
	async function choose(one, again = false) {
		if (!again) chosen.clear();
		recording = one;
		const found =
			one && one.id !== null ? (await getJson(`/api/library/recordings/${one.id}/runs`)).runs : [];
		// Another one was chosen meanwhile.
		if (recording !== one) return;
		runs = found;
		for (const id of chosen) if (!runs.some((run) => run.id === id)) chosen.delete(id);
		const there = runs.some(({ id }) => id === focused);
		await focus(there && again ? focused : (runs[0]?.id ?? null));
		if (!again) recordings.reveal();
	}

	/** @param {number | null} id */
	async function focus(id) {
		focused = id;
		show();
		await small.show(focusedRun());
	}

	/** Once runs are deleted the focus is on the row in the place of the one that was looked at. */
	function leave() {
		const rows = () => all("tr[data-run]", root);
		const at = rows().findIndex(({ dataset }) => Number(dataset.run) === focused);
		return async () => {
			await refresh();
			const left = rows();
			(left[Math.max(0, Math.min(at, left.length - 1))] ?? recordings.find).focus();
		};
	}

	/** @param {number} id */
	function tick(id) {
		if (!chosen.delete(id)) chosen.add(id);
		show();
	}

	/** @param {Server.KeptRunInfo} run @param {{name?: string, star?: boolean, note?: string}} what */
	async function change(run, what) {
		const { name: title, ...marks } = what;
		if (!(await actions.command("mark_run", { run: run.id, title, ...marks }))) return show();
		runs = runs.map((one) => (one.id === run.id ? { ...one, ...what } : one));
		await focus(focused);
	}

	/** Have a name written in the run's row. */
	function rename() {
		const run = focusedRun();
		const cell = root.querySelector(`tr[data-run="${focused}"] td:nth-child(2)`);
		if (!run || !cell) return;
		writing = true;
		const done = (/** @type {string | null} */ name) => {
			writing = false;
			if (name !== null && name !== run.name) void change(run, { name });
			else show();
		};
		const field = asks({ value: run.name, "aria-label": "Name of the run" }, done, true);
		fill(cell, field);
		field.select();
	}

	/** What a key does with the run that is shown in small. */
	/** @param {(run: Server.KeptRunInfo) => void} act */
	const ofFocused = (act) => () => {
		const run = focusedRun();
		if (run) act(run);
	};
	/** What a key does here. @type {Record<string, () => void>} */
	const KEYS = {
		Enter: ofFocused((run) => void small.open(run)),
		" ": ofFocused(({ id }) => tick(id)),
		s: ofFocused((run) => void change(run, { star: !run.star })),
		F2: rename,
		Delete: () => void bar.remove(chosen.size ? [...chosen] : focused === null ? [] : [focused]),
		"Ctrl+a": () => (listed().forEach(({ id }) => chosen.add(id)), show()),
		"/": () => recordings.find.focus(),
	};
	capture(document, "keydown", (event) => {
		if (store.get().place !== "library" || document.querySelector("dialog[open]")) return;
		const target = /** @type {HTMLElement} */ (event.target);
		const types = target.matches("input:not([type=checkbox])");
		if (event.key === "Escape" && !target.closest("[popover]")) {
			if (types) target.blur();
			else if (chosen.size) chooseNone();
			else location.hash = "#tune";
			return event.stopPropagation();
		}
		const control = event.ctrlKey || event.metaKey;
		if (types || event.altKey) return;
		if (recordings.walk(event)) return stopped(event);
		const act = KEYS[(control ? "Ctrl+" : "") + (control ? event.key.toLowerCase() : event.key)];
		const onButton = target.closest("button, a, input");
		if (!act || (onButton && ["Enter", " "].includes(event.key))) return;
		act();
		stopped(event);
	});
	/** @param {Event} event */
	function stopped(event) {
		claim(event);
	}
	root.addEventListener("focusin", ({ target }) => {
		const id = Number(/** @type {HTMLElement} */ (target).closest("tr")?.dataset.run);
		if (id && id !== focused) void focus(id);
	});

	/** @type {Timer} */
	let waiting;
	/** @type {Server.RunInfo["state"] | undefined} */
	let before;
	store.watch(["place", "run"], ({ place, run }) => {
		if (place !== "library") return;
		clearTimeout(waiting);
		if (!library) return void refresh();
		if (!runs.length && run?.state !== before) show();
		before = run?.state;
		if (run?.state === "done" || run?.state === "idle")
			waiting = setTimeout(() => void refresh(), KEPT_MS);
	});
	store.on(["place"], ({ place }) => {
		if (place === "library") void refresh();
	});
	let marks = store.get().server?.marks;
	store.on(["server"], ({ place, server }) => {
		// Who is writing goes on; what is written is news by itself.
		if (server?.marks === marks || writing || root.querySelector(".addnote:focus")) return;
		marks = server?.marks;
		if (place === "library") void refresh();
	});
	show();
}
