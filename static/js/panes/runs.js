// @ts-check
/** The current run and those before it in this tab: what they were made of, and the way back to them. */
import { fill, h, icon, show } from "../dom.js";
import { rateText, runWords } from "./top.js";

const MOST_RUNS = 50;

/** @param {HTMLElement} root @param {Context} context */
export function mountRuns(root, { store, page, actions }) {
	/** @type {PastRun[]} */
	let past = [];
	let counted = 0;
	const body = h("tbody", {});
	const words = [["Run", ""], ["At", ""], ["Sequence", ""], ["Methods", "opt-1"], ["State", ""], ["Changes", "num"], ["", "num"]];
	const head = h("tr", {}, words.map(([word, kind]) => h("th", { scope: "col", class: kind }, word)));
	const facts = h("span", {});
	const csv = h("button", { class: "btn up end", "data-tip": "Tracks of the current run, with all parameters", onclick: actions.exportTracks }, icon("i-export", "s"), "tracks.csv");
	root.append(
		h("div", { class: "scroll" }, h("table", { "aria-label": "Runs" }, h("thead", {}, head), body)),
		h("div", { class: "foot" }, facts, h("span", { class: "grow" }), csv),
	);

	function record() {
		const { run, server } = store.get();
		if (!run?.key || !server?.sequence) return;
		let entry = past.find((other) => other.key === run.key);
		if (!entry) {
			counted += 1;
			entry = {
				key: run.key,
				number: counted,
				at: new Date().toLocaleTimeString([], { hour12: false }),
				sequence: server.sequence.name,
				state: "",
				done: 0,
				total: run.total,
				speed: "",
				changes: server.changed.length,
				parameters: { ...server.parameters },
			};
			// A run that was overtaken before it showed anything is not worth a row.
			past = [entry, ...past.filter((other) => other.state !== "computing" || other.done > 0)].slice(0, MOST_RUNS);
		}
		for (const other of past) if (other !== entry && other.state === "computing") other.state = "overtaken";
		entry.state = runWords(run)[1];
		entry.done = run.done;
		entry.total = run.total;
		entry.speed = rateText({ ...run, seconds_left: null });
		render();
	}

	function render() {
		const { run, server, link } = store.get();
		const current = past[0];
		facts.textContent = current ? `${current.done} of ${current.total} steps${current.speed ? ` · ${current.speed}` : ""}` : "";
		csv.toggleAttribute("disabled", link !== "open" || !run?.done);
		fill(
			body,
			past.map((entry) => {
				const now = entry.key === run?.key;
				const same = entry.sequence === server?.sequence?.name;
				return h(
					"tr",
					{ "aria-selected": now },
					h("td", {}, entry.number),
					h("td", { class: "q" }, entry.at),
					h("td", {}, entry.sequence),
					h("td", { class: "q opt-1" }, `${show(entry.parameters.single_view)} · ${show(entry.parameters.fusion_method)}`),
					h("td", {}, `${entry.state} ${entry.done < entry.total ? `${entry.done}/${entry.total}` : ""}`),
					h("td", { class: "num" }, entry.changes),
					h(
						"td",
						{ class: "num" },
						now
							? h("span", { class: "q" }, "current")
							: h("button", { class: "btn", disabled: !same || link !== "open", title: same ? "Set all parameters to those of this run" : "Open its sequence first", onclick: () => page.change(entry.parameters) }, "use again"),
					),
				);
			}),
		);
	}

	store.on(["run", "server", "link"], record);
}
