// @ts-check
/** The current run and those before it in this tab: what they were made of, and the way back to them. */
import { h, parts, show } from "../dom.js";
import { grid } from "../grid.js";
import { rateText, runWords } from "./top.js";

const MOST_RUNS = 50;

/** @type {Pane} */
export function mountRuns(root, { store, actions }) {
	const { facts, csv } = parts(root);
	/** @type {PastRun[]} */
	let past = [];
	let counted = 0;
	const again = (/** @type {PastRun} */ { key, sequence, parameters }) => {
		const { run, sequence: open, link } = store.get();
		if (key === run?.key) return h("span", { class: "q" }, "current");
		const same = sequence === open?.name;
		const tip = same ? "Set all parameters to those of this run" : "Open its sequence first";
		return h("button", { class: "btn", disabled: !same || link !== "open", title: tip, onclick: () => actions.change(parameters) }, "use again");
	};
	/** @type {Column<PastRun>[]} */
	const columns = [
		{ word: "Run", cell: ({ number }) => number },
		{ word: "At", kind: "q", cell: ({ at }) => at },
		{ word: "Sequence", cell: ({ sequence }) => sequence },
		{ word: "Methods", kind: "q opt-1", cell: ({ parameters: p }) => `${show(p.single_view)} · ${show(p.fusion_method)}` },
		{ word: "State", cell: ({ state, done, total }) => `${state}${done < total ? ` ${done}/${total}` : ""}` },
		{ word: "Changes", kind: "num", cell: ({ changes }) => changes },
		{ word: "", kind: "num", cell: again },
	];
	const table = grid("Runs", columns, { key: ({ number }) => number });
	root.prepend(table.element);

	function record() {
		const { run, server, link } = store.get();
		if (!run?.key || !server?.sequence) return;
		let entry = past.find((other) => other.key === run.key);
		if (!entry) {
			counted += 1;
			const at = new Date().toLocaleTimeString([], { hour12: false });
			entry = { key: run.key, number: counted, at, sequence: server.sequence.name, state: "", done: 0, total: run.total, speed: "", changes: server.changed.length, parameters: server.parameters };
			// A run that was overtaken before it showed anything is not worth a row.
			past = [entry, ...past.filter((other) => other.state !== "computing" || other.done > 0)].slice(0, MOST_RUNS);
		}
		for (const other of past) if (other !== entry && other.state === "computing") other.state = "overtaken";
		Object.assign(entry, { state: runWords(run)[1], done: run.done, total: run.total, speed: rateText({ ...run, seconds_left: null }) });
		facts.textContent = `${entry.done} of ${entry.total} steps${entry.speed ? ` · ${entry.speed}` : ""}`;
		csv.disabled = link !== "open" || !run.done;
		table.show(past);
		table.each(({ key }, row) => row.setAttribute("aria-selected", String(key === run.key)));
	}

	store.on(["run", "server", "link"], record);
}
