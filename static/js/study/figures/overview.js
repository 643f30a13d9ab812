/** The figures of a study: its trials, what matters, each parameter. */
import { fill, h, write, symbolOf } from "../../elements/dom.js";
import { MOST_PARAMETERS, against, bestSoFar, scatter } from "./charts.js";
import { clear } from "./plotting.js";
import { figureOf } from "../words.js";

/** @import { Measure } from "./charts.js" */

/** Letters of a figure's name beyond which it is not said again beside others. */
const LONG = 16;

/**
 * @param {object} on
 * @param {(number: number) => void} on.choose
 * @param {(key: string, low: number, high: number) => void} on.narrow
 */
export function overview({ choose, narrow }) {
	/** @type {{study: Server.Study | null, done: Server.TrialInfo[], chosen: number | null}} */
	let shown = { study: null, done: [], chosen: null };
	/** Key of the figure along the other axis. */
	let across = "";
	const axes = h("div", { class: "seg", role: "group", "aria-label": "Axes" });
	const pareto = h("div", { class: "fill", role: "img" });
	const scat = h(
		"section",
		{ class: "pane scat", "aria-label": "Trials" },
		h(
			"div",
			{ class: "pane-head" },
			h("h2", { class: "pane-title" }, "Trials"),
			axes,
			h("span", { class: "grow" }),
			legend(),
		),
		pareto,
	);
	const bars = h("div", { class: "ibars" });
	const aside = h("p", { class: "small ifoot" });
	const of = h("span", { class: "sub" });
	const since = h("span", { class: "q" });
	const sofar = h("div", { class: "fill", role: "img" });
	const matters = h(
		"section",
		{ class: "pane imp", "aria-label": "What matters" },
		h(
			"div",
			{ class: "pane-head" },
			h("h2", { class: "pane-title" }, "What matters"),
			h("span", { class: "grow" }),
			of,
		),
		bars,
		aside,
		h(
			"div",
			{ class: "sofar" },
			h("div", { class: "mh" }, h("span", {}, "Best so far"), h("span", { class: "grow" }), since),
			sofar,
		),
	);
	const each = h("h2", { class: "pane-title" }, "Each parameter");
	const grid = h("div", { class: "mgrid" });
	const narrowing = h("span", { class: "sub" });
	const multiples = h(
		"section",
		{ class: "pane mult", "aria-label": "Each parameter" },
		h("div", { class: "pane-head" }, each, h("span", { class: "grow" }), narrowing),
		grid,
	);

	/** A figure of the study by its place among the objectives. @param {number} k @returns {Measure} */
	const measure = (k) => ({
		name: shown.study?.objectives[k].name ?? "",
		of: /** @type {Server.ObjectiveInfo} */ (shown.study?.objectives[k]),
		at: (trial) => trial.objectives?.[k],
	});

	/** What the other axis may show. @returns {Measure[]} */
	function measures() {
		/** @type {Measure[]} */
		const more = (shown.study?.objectives ?? []).map((_, k) => measure(k)).slice(1);
		const beside = shown.study?.beside ?? [];
		// the camera that was left out, else where people are
		const of = beside.find((one) => one.of === "agreement") ?? beside.at(-1);
		if (of && (of.of === "agreement" || !more.length))
			more.push({ name: of.name, of, at: ({ figures }) => figures[of.key] });
		more.push({
			name: "time",
			of: {
				key: "seconds",
				name: "time",
				help: "",
				higher: false,
				unit: "s",
				digits: 1,
				of: "run",
			},
			at: ({ seconds }) => seconds,
		});
		return more;
	}

	/** @param {Server.Study} now */
	function showMatters({ importance, importance_trials: count, varied, objectives }) {
		const { name } = objectives[0];
		fill(of, `share of ${name.length > LONG ? "the" : `${name}'s`} variance`);
		const most = Math.max(...importance.map(({ share, spread }) => share + spread), 0.01);
		fill(
			bars,
			importance.map(({ key, share, spread }) => {
				const range = varied.find((one) => one.key === key);
				const from = Math.max(0, share - spread);
				return h(
					"div",
					{ class: "ib" },
					h(
						"span",
						{ class: "lab", title: range ? `${range.label}: ${range.help}` : key },
						h("span", {}, range?.label ?? key),
						range && symbolOf(range.symbol),
					),
					h(
						"span",
						{ class: "tr" },
						h("i", { "--w": `${(share / most) * 100}%` }),
						h("u", {
							"--l": `${(from / most) * 100}%`,
							"--w": `${((share + spread - from) / most) * 100}%`,
						}),
					),
					h("span", { class: "num" }, `${Math.round(share * 100)} %`),
				);
			}),
		);
		write(
			aside,
			importance.length
				? `The thin line is how sure that is with ${count} trials.`
				: "Too few trials to tell yet.",
		);
	}

	async function draw() {
		const { study: now, done, chosen } = shown;
		if (!now) return;
		if (!done.length) {
			// of the study that was shown before nothing stays
			for (const figure of [pareto, sofar, ...grid.querySelectorAll(".fill")]) clear(figure);
			fill(pareto, h("p", { class: "blank" }, "The default is run first, then the trials come."));
			fill(axes);
			fill(since);
			fill(grid);
			grid.dataset.keys = "";
			return;
		}
		const y = measure(0);
		const others = measures();
		const x = others.find(({ of: { key } }) => key === across) ?? others[0];
		fill(
			axes,
			others.map(({ of: { key }, name: word }) =>
				h(
					"button",
					{
						"aria-pressed": String(key === x.of.key),
						onclick: () => ((across = key), void draw()),
					},
					y.name.length > LONG ? `against ${word}` : `${y.name} · ${word}`,
				),
			),
		);
		const complete = done.filter(({ state }) => state === "complete");
		const told = { best: now.best, chosen };
		const top = now.best === null ? undefined : done.find(({ number }) => number === now.best);
		const worth = figureOf(top?.objectives?.[0], y.of);
		pareto.ariaLabel = `${y.name} against ${x.name} of ${complete.length} trials; the best is ${now.best ? `trial ${now.best}` : "the default"} with ${worth}`;
		sofar.ariaLabel = `Best ${y.name} over the trials: ${worth} now`;
		const after = top ? done.length - 1 - done.findIndex(({ number }) => number === top.number) : 0;
		fill(
			since,
			now.best === 0
				? "the default is as good"
				: after
					? `nothing better for ${after} ${after === 1 ? "trial" : "trials"}`
					: "",
		);
		fill(each, `Each parameter against ${y.name}`);
		const running = now.info.state === "running";
		fill(narrowing, running ? "" : "drag over a range to try a narrower one");
		const ranked = [...now.varied]
			.sort((a, b) => share(now, b.key) - share(now, a.key))
			.slice(0, MOST_PARAMETERS);
		const keys = ranked.map(({ key }) => key).join();
		if (grid.dataset.keys !== keys) {
			grid.dataset.keys = keys;
			fill(grid, ranked.map(cell));
		}
		const cells = [...grid.querySelectorAll(".mp")];
		try {
			await scatter(pareto, complete, x, y, told, choose);
			await bestSoFar(sofar, done, y, now.info.trials ?? done.length);
			for (const [k, range] of ranked.entries()) {
				const value = top && range.key in top.values ? top.values[range.key] : range.default;
				const [head, figure] = /** @type {HTMLElement[]} */ ([...cells[k].children]);
				write(
					/** @type {Node} */ (head.lastChild),
					typeof value === "number" ? String(Number(value.toPrecision(3))) : String(value),
				);
				await against(
					figure,
					complete,
					range,
					y,
					told,
					choose,
					running ? null : (low, high) => narrow(range.key, low, high),
				);
			}
		} catch (error) {
			fill(pareto, h("p", { class: "blank" }, /** @type {Error} */ (error).message));
		}
	}

	/** @param {Server.Study} now @param {string} key */
	const share = (now, key) => now.importance.find((one) => one.key === key)?.share ?? 0;

	/** @param {Server.RangeInfo} range */
	const cell = ({ label, symbol, help }) =>
		h(
			"div",
			{ class: "mp" },
			h(
				"div",
				{ class: "mh", title: `${label}: ${help}` },
				h("span", { class: "lab" }, h("span", {}, label), symbolOf(symbol)),
				h("span", { class: "grow" }),
				h("span", { class: "q" }, "best"),
				h("b"),
			),
			h("div", { class: "fill", role: "img", "aria-label": `${label} against the leading figure` }),
		);

	/**
	 * @param {Server.Study} study
	 * @param {Server.TrialInfo[]} done  in the order in which they ended
	 * @param {number | null} chosen
	 */
	function show(study, done, chosen) {
		shown = { study, done, chosen };
		showMatters(study);
		return draw();
	}

	return { elements: [scat, matters, multiples], show };
}

/** What the signs of the figure mean. */
function legend() {
	const signs = [
		["dot", "trial"],
		["line", "front"],
		["diamond", "default"],
		["best", "best"],
	];
	return h(
		"div",
		{ class: "legend" },
		signs.map(([kind, word]) => h("span", {}, h("i", { class: `sign ${kind}` }), word)),
	);
}
