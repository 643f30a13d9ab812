// @ts-check
/** The shown run against the truth: B beside A, the pinned run or else the finished one before. */
import { fill, fixed, h, parts, show } from "../dom.js";
import { scoresOf } from "../events.js";
import { grid } from "../grid.js";

/** @type {Record<Verdict, string>} */
const SIGNS = { better: "▲ better", worse: "▼ worse", same: "= same", different: "≠ different", undefined: "–" };

/** @type {Pane} */
export function mountCompare(root, { store }) {
	const { sides, pair, settings, more, unpin, pin, blank } = parts(root);
	let all = false;
	/** @type {Map<string, string>} */
	let help = new Map();
	/** @type {Column<Difference>[]} */
	const measures = [
		{ word: "Measure", cell: ({ label, unit }) => [label, unit && h("span", { class: "q" }, ` ${unit}`)] },
		{ word: "A", kind: "num q", cell: ({ a, digits }) => fixed(a, digits) },
		{ word: "B", kind: "num", cell: ({ b, digits }) => fixed(b, digits) },
		{ word: "Difference", kind: "num", cell: ({ comparable, difference, digits }) => (comparable ? fixed(difference, digits, true) : "–") },
		{ word: "B is", cell: ({ comparable, verdict }) => h("span", { class: verdict }, comparable ? SIGNS[verdict] : "other settings") },
	];
	const figures = grid("Figures", measures, { key: ({ name }) => name, attributes: ({ name, settings: how }) => ({ title: [help.get(name), how].filter(Boolean).join("\n") }) });
	const label = (/** @type {string} */ key) => store.get().schema?.parameters.find((p) => p.key === key)?.label ?? show(key);
	/** @type {Column<{key: string, a: any, b: any}>[]} */
	const values = [
		{ word: "B differs in", cell: ({ key }) => label(key) },
		{ word: "A", kind: "num q", cell: ({ a }) => show(a) },
		{ word: "B", kind: "num", cell: ({ b }) => show(b) },
	];
	const differs = grid("Parameters that differ", values, { key: ({ key }) => key, attributes: ({ key }) => ({ title: key }) });
	differs.element.classList.add("differs");
	pair.append(figures.element, differs.element);
	more.addEventListener("click", () => {
		all = !all;
		render();
	});

	/** @param {string} name @param {ComparedRun} run */
	function side(name, run) {
		const count = Object.keys(run.changed).length;
		return `${name}, ${count ? `${count} change${count > 1 ? "s" : ""}` : "default parameters"}${run.partial ? ", partial" : ""}`;
	}

	function render() {
		const state = store.get();
		const { server, run, link } = state;
		const scores = scoresOf(state);
		blank.hidden = scores !== null;
		const [title, text] = !server?.sequence
			? ["Figures appear here", "once a sequence with truth is open."]
			: server.sequence.has_truth
				? ["Not scored yet", "The tracks are set against the truth while the run goes on."]
				: ["There is no truth to compare with", `${server.sequence.name} names no file of true positions ([ground_truth] in sequence.toml), so its tracks cannot be scored.`];
		fill(blank, h("h3", {}, title), h("p", {}, text));
		if (!scores || !server) return;
		const { evaluation, comparison, series } = scores;
		/** @type {Difference[]} */
		const rows = comparison?.rows ?? evaluation.figures.map((f) => ({ ...f, a: null, b: f.value, difference: null, verdict: "undefined", comparable: true }));
		help = new Map(evaluation.figures.map((f) => [f.name, f.help]));
		figures.show(rows.filter(({ headline }) => all || headline));
		differs.element.hidden = !comparison?.parameters.length;
		differs.show(comparison?.parameters ?? []);
		fill(
			sides,
			comparison
				? [h("b", {}, "A"), side(comparison.against === "pinned" ? "pinned run" : "run before", comparison.a), h("b", {}, "B"), side("this run", comparison.b), h("span", { class: "opt-1" }, `· ${comparison.steps} steps`)]
				: [h("b", {}, "B"), `this run, ${evaluation.steps} steps${evaluation.partial ? " so far" : ""} · no run to compare with: pin this one, or change a parameter`],
		);
		const how = `${series.gate} · ${series.cost}`;
		fill(settings, how);
		settings.title = [how, ...evaluation.notes].join("\n");
		fill(more, all ? "Fewer" : "All figures");
		unpin.hidden = !server.pinned;
		unpin.disabled = link !== "open";
		pin.disabled = link !== "open" || run?.state !== "done" || server.pinned?.key === run.key;
	}

	store.on(["scores", "basis", "server", "run", "schema", "link"], render);
	render();
}
