// @ts-check
/** The shown run against the truth: B beside A, the pinned run or else the finished one before. */
import { fill, h, icon, show } from "../dom.js";
import { scoresOf } from "../events.js";

/** @type {Record<Verdict, string>} */
const SIGNS = { better: "▲", worse: "▼", same: "=", different: "≠", undefined: "" };

/** @param {number | null} value @param {number} digits @param {boolean} [signed] */
export function figure(value, digits, signed = false) {
	if (value === null) return "–";
	const text = Math.abs(value).toFixed(digits);
	const sign = Number(text) === 0 ? "" : value < 0 ? "−" : signed ? "+" : "";
	return sign + text;
}

/** @param {HTMLElement} root @param {Context} context */
export function mountCompare(root, { store, page }) {
	let all = false;
	const row = (/** @type {string[]} */ words) => h("tr", {}, words.map((word, k) => h("th", { scope: "col", class: k > 0 && word !== "B is" ? "num" : "" }, word)));
	const figures = h("tbody", {});
	const values = h("tbody", {});
	const differs = h("table", { class: "differs", "aria-label": "Parameters that differ" }, h("thead", {}, row(["B differs in", "A", "B"])), values);
	const sides = h("div", { class: "foot sides" });
	const settings = h("span", { class: "grow cut" });
	const more = h("button", { class: "btn", onclick: () => {
		all = !all;
		render();
	} });
	const pin = h("button", { class: "btn up end", "data-tip": "Later runs are compared with this one", onclick: () => page.pin(true) }, "Pin as A");
	const unpin = h("button", { class: "btn up end", "data-tip": "Compare with the run before", onclick: () => page.pin(false) }, "Unpin A");
	const report = h("a", { class: "btn up end", href: "/api/export/report.html", download: true, "data-tip": "All of it as one HTML file" }, icon("i-export", "s"), "Report");
	const tables = h("div", { class: "scroll pair" }, h("table", { "aria-label": "Figures" }, h("thead", {}, row(["Measure", "A", "B", "Difference", "B is"])), figures), differs);
	const blank = h("div", { class: "blank" });
	root.append(sides, tables, h("div", { class: "foot" }, settings, more, unpin, pin, report), blank);

	/** @param {string} name @param {ComparedRun} run */
	function side(name, run) {
		const count = Object.keys(run.changed).length;
		return `${name}, ${count ? `${count} change${count > 1 ? "s" : ""}` : "default parameters"}${run.partial ? ", partial" : ""}`;
	}

	function render() {
		const state = store.get();
		const { server, run, schema, link } = state;
		const scores = scoresOf(state);
		const truth = server?.sequence?.has_truth;
		blank.hidden = scores !== null;
		if (!server?.sequence) fill(blank, h("h3", {}, "Figures appear here"), h("p", {}, "once a sequence with truth is open."));
		else if (!truth) fill(blank, h("h3", {}, "There is no truth to compare with"), h("p", {}, `${server.sequence.name} names no file of true positions ([ground_truth] in sequence.toml), so its tracks cannot be scored.`));
		else if (!scores) fill(blank, h("h3", {}, "Not scored yet"), h("p", {}, "The tracks are set against the truth while the run goes on."));
		if (!scores || !server) return;
		const { evaluation, comparison, series } = scores;
		/** @type {Difference[]} */
		const rows = comparison?.rows ?? evaluation.figures.map((f) => ({ ...f, a: null, b: f.value, difference: null, verdict: "undefined", comparable: true }));
		const help = new Map(evaluation.figures.map((f) => [f.name, f.help]));
		fill(
			figures,
			rows.filter(({ headline }) => all || headline).map(({ name, label, unit, digits, a, b, difference, verdict, comparable, settings: how }) =>
				h(
					"tr",
					{ title: [help.get(name), how].filter(Boolean).join("\n") },
					h("td", {}, label, unit && h("span", { class: "q" }, ` ${unit}`)),
					h("td", { class: "num q" }, figure(a, digits)),
					h("td", { class: "num" }, figure(b, digits)),
					h("td", { class: "num" }, comparable ? figure(difference, digits, true) : "–"),
					h("td", { class: verdict }, comparable ? `${SIGNS[verdict]} ${verdict === "undefined" ? "–" : verdict}` : "other settings"),
				),
			),
		);
		const labels = new Map(schema?.parameters.map(({ key, label }) => [key, label]));
		differs.hidden = !comparison?.parameters.length;
		fill(values, (comparison?.parameters ?? []).map(({ key, a, b }) => h("tr", { title: key }, h("td", {}, labels.get(key) ?? key.replaceAll("_", " ")), h("td", { class: "num q" }, show(a)), h("td", { class: "num" }, show(b)))));
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
		unpin.toggleAttribute("disabled", link !== "open");
		pin.toggleAttribute("disabled", link !== "open" || run?.state !== "done" || server.pinned?.key === run.key);
	}

	store.on(["scores", "basis", "server", "run", "schema", "link"], render);
	render();
}
