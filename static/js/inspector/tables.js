/**
 * The panels are drawn while they are looked at, when something that they tell of is new. Beside
 * them what two panels have of their own: the check of identities, and the steps that somebody
 * marked.
 */
import { all, allow, one, parts, remember, remembered, write, fill, h } from "../elements/dom.js";
import { redraw, signButton } from "../elements/drawn.js";
import { valuesOf } from "../state/actions.js";
import { fetcher, getJson } from "../state/api.js";
import { eventsNow, scoresOf } from "../state/events.js";
import { compareTables, eventTable, runTable, seriesOf, stepTables } from "./panels.js";
import { teachPanel } from "./taught.js";

/* ---------- The check of identities without truth: begun and stopped. ---------- */

/** @param {Context} context */
export function mountIdentity({ store, actions }) {
	const read = fetcher(async () => store.set({ identity: await getJson("/api/identity") }));
	// It may have been begun in another window, or before this page was loaded.
	/** @type {Server.Task | undefined} */
	let heard;
	store.watch(["tasks"], ({ tasks: { identity } }) => {
		if (JSON.stringify(identity) === JSON.stringify(heard)) return;
		heard = identity;
		void read();
	});
	actions.checkIdentities = (what) =>
		void actions.ask(what === "stop" ? "DELETE" : "POST", "identity");
}

/* ---------- Steps that somebody marked, each with a note: kept in this browser for each
   recording. */

const nameOf = (/** @type {string} */ recording) => `bookmarks ${recording}`;

/** @param {HTMLElement} root @param {Context} context */
export function mountBookmarks(root, { store, actions, playback }) {
	let recording = "";

	/** @param {number} step @param {string | null} note  null: it is taken away */
	function put(step, note) {
		const others = store.get().bookmarks.filter((mark) => mark.step !== step);
		const all = note === null ? others : [...others, { step, note }];
		store.set({ bookmarks: all.sort((a, b) => a.step - b.step) });
	}

	function list() {
		const { bookmarks } = store.get();
		root.hidden = bookmarks.length === 0;
		// A note that was just written stands there already, and a list that is drawn anew takes the
		// button away on which its writer is pressing.
		const notes = all("input", root);
		const same = (/** @type {Bookmark} */ { step, note }, /** @type {number} */ k) =>
			notes[k].id === `note-${step}` && notes[k].value === note;
		if (notes.length === bookmarks.length && bookmarks.every(same)) return;
		const held = document.activeElement?.id;
		fill(
			root,
			bookmarks.map(({ step, note }) =>
				h(
					"li",
					h(
						"button.btn.box",
						{ "aria-label": `Go to step ${step}`, onclick: () => playback.seek(step) },
						step,
					),
					h("input", {
						id: `note-${step}`,
						"aria-label": `Note of step ${step}`,
						placeholder: "note",
						value: note,
						maxlength: 200,
						onchange: (/** @type {Event} */ { target }) =>
							put(step, /** @type {HTMLInputElement} */ (target).value),
						onkeydown: (/** @type {KeyboardEvent} */ { key, target }) =>
							["Enter", "Escape"].includes(key) && /** @type {HTMLElement} */ (target).blur(),
					}),
					signButton("i-close", `Forget step ${step}`, () => put(step, null)),
				),
			),
		);
		if (held?.startsWith("note-")) document.getElementById(held)?.focus();
	}

	store.watch(["sequence"], ({ sequence }) => {
		if (!sequence || sequence.opened_as === recording) return;
		recording = sequence.opened_as;
		store.set({ bookmarks: remembered(nameOf(recording), []) });
	});
	store.on(["bookmarks"], ({ bookmarks }) => {
		list();
		if (recording) remember(nameOf(recording), bookmarks);
	});
	actions.bookmark = () => {
		const { shown, bookmarks } = store.get();
		actions.showTab("events");
		if (shown >= 0 && !bookmarks.some(({ step }) => step === shown)) put(shown, "");
		list();
		// Once the panel is there.
		requestAnimationFrame(() => document.getElementById(`note-${shown}`)?.focus());
	};
	list();
}

/**
 * What a panel tells of, what it asks the server for, and how it is drawn; null: not yet.
 * @type {Record<string, {
 *   keys: (keyof PageState)[],
 *   read?: (state: Readonly<PageState>) => Promise<any>,
 *   draw: (state: Readonly<PageState>, told: any, actions: Actions) => Child | Child[],
 * }>}
 */
const TABLES = {
	step: { keys: ["result", "scores", "basis", "names"], read: seriesOf, draw: stepTables },
	events: {
		keys: ["timeline", "scores", "basis", "eventKind", "identity"],
		draw: eventTable,
	},
	teach: { keys: ["server"], read: () => getJson("/api/teach"), draw: teachPanel },
	compare: {
		keys: ["scores", "basis", "every", "identity", "schema"],
		read: async ({ scores }) => (scores?.reference ? getJson("/api/evaluation/comparison") : null),
		draw: compareTables,
	},
	runs: { keys: ["server", "run"], read: () => getJson("/api/runs"), draw: runTable },
};

/** @type {Pane} */
export function mountTables(root, context) {
	const { store, actions } = context;
	const { kind, pin, unpin, swap, place, more, report } = parts(root);
	for (const [name, { keys, read, draw }] of Object.entries(TABLES)) {
		const body = one(`#panel-${name} [data-fill]`, root);
		const refresh = fetcher(async () => {
			const wanted = () => store.get().tab === name && store.get().sequence;
			if (!wanted()) return;
			const told = await read?.(store.get());
			// What is wrong with a drawing is not taken for a lost server.
			queueMicrotask(() => {
				const drawn = wanted() ? draw(store.get(), told, actions) : null;
				if (drawn) redraw(body, drawn);
			});
		});
		store.watch([...keys, "tab", "sequence"], refresh);
	}

	actions.swap = async () => {
		const { server, run } = store.get();
		if (!server?.pinned || run?.state !== "done") return;
		const { parameters, differs } = server.pinned;
		if (!(await actions.ask("POST", "run/pin"))) return;
		await actions.change(Object.fromEntries(differs.map((key) => [key, parameters[key]])));
	};

	actions.copyRun = async (what) => {
		const { server } = store.get();
		if (!server?.sequence) return;
		const text = what === "json" ? JSON.stringify(valuesOf(server), null, 2) : server.command;
		try {
			await navigator.clipboard.writeText(text);
			actions.note("info", "Copied", text.length < 400 ? text : "");
		} catch {
			actions.note("warn", "The browser does not let the page use the clipboard", text);
		}
	};

	kind.addEventListener("change", () =>
		store.set({ eventKind: /** @type {LaneEvent["kind"]} */ (kind.value) }),
	);
	more.addEventListener("click", () => store.set({ every: !store.get().every }));

	/** @type {Promise<void> | undefined} */
	let parameters;
	store.watch(["tab"], ({ tab }) => {
		if (tab !== "parameters") return;
		parameters ??= import("./parameters.js").then(
			({ mountParameters }) => mountParameters(one("#panel-parameters", root), context),
			() => void (parameters = undefined),
		);
	});

	function controls() {
		const state = store.get();
		const { server, sequence, run, link, every } = state;
		const locked = link !== "open" || !sequence;
		unpin.hidden = swap.hidden = !server?.pinned;
		const unfinished = locked
			? "There is no run."
			: run?.state === "done"
				? ""
				: "This run is not finished.";
		allow(
			swap,
			unfinished || (server?.pinned?.differs.length ? "" : "A and B have the same values."),
		);
		allow(pin, unfinished || (server?.pinned?.key === run?.key ? "This run is A." : ""));
		const scored = scoresOf(state)?.series.partial === false;
		allow(
			report,
			sequence && !sequence.has_truth
				? "A report compares with the truth, and this recording has none."
				: unfinished || (scored ? "" : "This run is not scored yet."),
		);
		if (report.ariaDisabled) report.removeAttribute("href");
		else report.setAttribute("href", "/api/export/report.html");

		write(more, every ? "Headlines" : "All figures");
	}
	store.watch(["server", "link", "run", "every", "sequence", "scores", "basis"], controls);
	store.watch(["shown", "timeline", "scores", "eventKind"], (state) => {
		const events = eventsNow(state);
		const past = events.filter(({ step }) => step <= state.shown).length;
		write(place, events.length ? `${past} of ${events.length}` : "");
	});
	store.watch(["eventKind"], ({ eventKind }) => (kind.value = eventKind));
	// Until here a click would have been lost.
	for (const name of ["events", "compare"]) one(`#panel-${name}`, root).inert = false;
}
