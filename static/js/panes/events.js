// @ts-check
/** The table of events: the lanes' signs as rows, to be listed by kind and gone to. */
import { secondsOf } from "../clock.js";
import { choices, fill, h, idTag, parts, write } from "../dom.js";
import { eventsNow } from "../events.js";
import { grid } from "../grid.js";

/** Rows beyond this are counted, not drawn. */
const MOST_ROWS = 500;
/** @type {[string, string][]} */
const KINDS = [["", "all"], ["birth", "births"], ["death", "deaths"], ["switch", "switches"], ["long miss", "long misses"]];

/** @type {Pane} */
export function mountEvents(root, { store, actions, playback }) {
	const { kind, words, blank } = parts(root);
	/** @type {Column<LaneEvent>[]} */
	const columns = [
		{ word: "Step", kind: "num", cell: ({ step }) => step, by: ({ step }) => step },
		{ word: "Time  s", kind: "num", cell: ({ step }) => secondsOf(step, store.get().server?.sequence?.fps ?? 25) },
		{ word: "Event", cell: ({ kind }) => kind, by: ({ kind }) => KINDS.findIndex(([name]) => name === kind) },
		{ word: "Track", cell: ({ id }) => idTag(id), by: ({ id }) => id },
	];
	const table = grid("Events", columns, {
		key: ({ step, id, kind }) => `${kind} ${id} ${step}`,
		by: "Step",
		choose: ({ step, id }) => {
			store.set({ playing: 0 });
			playback.seek(step);
			actions.select(id);
		},
	});
	root.prepend(table.element);
	choices(kind, KINDS, "");
	kind.addEventListener("change", () => store.set({ eventKind: kind.value }));

	function list() {
		const events = eventsNow(store.get());
		table.show(events.slice(0, MOST_ROWS));
		blank.hidden = events.length > 0;
		if (!events.length) fill(blank, h("h3", {}, "No such event"), h("p", {}, "Births, deaths, switches of identity and long misses are listed as they are found."));
		now();
	}
	function now() {
		const { shown, selection, tab } = store.get();
		if (tab !== "events") return;
		const events = eventsNow(store.get());
		const place = events.filter(({ step }) => step <= shown).length;
		write(words, `${place} of ${events.length} up to step ${Math.max(0, shown)}`);
		table.each(({ step, id }, row) => row.setAttribute("aria-selected", String(step === shown && id === selection)));
	}
	store.on(["timeline", "scores", "eventKind", "tab"], () => store.get().tab === "events" && list());
	store.on(["shown", "selection"], now);
	list();
}
