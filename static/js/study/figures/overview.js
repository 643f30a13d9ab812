/** The figures of a study: its trials, what matters, each parameter. */
import { fill, h, write, symbolOf } from "../../elements/dom.js";
import { figureOf, titledOf, valueOf } from "../words.js";
import { clear, core, draw, inks, layoutOf, marks, onClick, points, upright } from "./plotting.js";

/* ---------- The figures of a study; the table says the same in words. ---------- */

/** Trials that are shown against each parameter: a place for each. */
const MOST_PARAMETERS = 6;

/** @typedef {{name: string, of: Server.ObjectiveInfo, at: (trial: Server.TrialInfo) => number | null | undefined}} Measure */

/**
 * The trials by two figures, with those that nothing beats in both.
 * @param {HTMLElement} place
 * @param {Server.TrialInfo[]} trials
 * @param {Measure} x
 * @param {Measure} y
 * @param {{best: number | null, chosen: number | null}} which
 * @param {(number: number) => void} choose
 */
async function scatter(place, trials, x, y, which, choose) {
	const ink = inks();
	const known = trials.filter((trial) => x.at(trial) != null && y.at(trial) != null);
	const values = (/** @type {Measure} */ of) => known.map((trial) => Number(of.at(trial)));
	const seen = known.filter(({ number }) => !number || number === which.best);
	const [across, up] = [x, y].map((of) =>
		core(
			values(of),
			seen.map((one) => Number(of.at(one))),
		),
	);
	const outside = known.filter((trial) => {
		const [a, b] = [Number(x.at(trial)), Number(y.at(trial))];
		return a < across[0] || a > across[1] || b < up[0] || b > up[1];
	}).length;
	const better = (/** @type {Measure} */ { of }) =>
		of.higher ? "more is better" : "less is better";
	const says = `trial %{customdata}<br>${y.name} %{y:.4g}<br>${x.name} %{x:.4g}<extra></extra>`;
	const front = unbeaten(known, x, y);
	const worst = up[y.of.higher ? 0 : 1];
	/** @type {[number, number][]} */
	const stairs = front.map((trial) => [Number(x.at(trial)), Number(y.at(trial))]);
	if (stairs.length) {
		const [first, last] = [stairs[0], stairs[stairs.length - 1]];
		stairs.unshift(x.of.higher ? [across[0], first[1]] : [first[0], worst]);
		stairs.push(x.of.higher ? [last[0], worst] : [across[1], last[1]]);
	}
	const note = (/** @type {Server.TrialInfo} */ trial) => figureOf(y.at(trial), y.of);
	await draw(
		place,
		[
			points(known, x.at, y.at, ink, 6, says),
			{
				mode: "lines",
				type: "scatter",
				x: stairs.map(([a]) => a),
				y: stairs.map(([, b]) => b),
				line: { color: ink.accent, width: 1.25, shape: x.of.higher ? "vh" : "hv" },
				hoverinfo: "skip",
			},
			{
				mode: "markers",
				type: "scatter",
				x: front.map(x.at),
				y: front.map(y.at),
				customdata: front.map(({ number }) => number),
				marker: { color: ink.accent, size: 6 },
				hovertemplate: `front: ${says}`,
			},
			...marks(known, which, x.at, y.at, ink, note, (across[0] + across[1]) / 2),
		],
		{
			...layoutOf(
				ink,
				{ range: across, title: { text: `${titledOf(x.of)}, ${better(x)}`, standoff: 6 } },
				{ range: up, title: { text: upright(place, titledOf(y.of), better(y)), standoff: 6 } },
				[58, 20, 18, 40],
			),
			annotations: outside
				? [
						{
							text: `${outside} ${outside === 1 ? "trial lies" : "trials lie"} outside`,
							xref: "paper",
							yref: "paper",
							x: 1,
							y: 0,
							xanchor: "right",
							yanchor: "bottom",
							showarrow: false,
							font: { size: ink.size, color: ink.faint },
						},
					]
				: [],
		},
	);
	onClick(place, choose);
}

/**
 * Those that no other beats in one of two figures without losing in the other, by the first.
 * @param {Server.TrialInfo[]} trials
 * @param {Measure} x
 * @param {Measure} y
 */
export function unbeaten(trials, x, y) {
	const worth = (/** @type {Measure} */ { of, at }, /** @type {Server.TrialInfo} */ trial) =>
		(of.higher ? 1 : -1) * Number(at(trial));
	const free = trials
		.filter(({ vetoed }) => !vetoed)
		.sort((a, b) => worth(x, b) - worth(x, a) || worth(y, b) - worth(y, a));
	let top = -Infinity;
	const found = free.filter((trial) => {
		const now = worth(y, trial);
		if (now <= top) return false;
		top = now;
		return true;
	});
	return x.of.higher ? found.reverse() : found;
}

/**
 * The best figure over the trials; what is still to come stays empty.
 * @param {HTMLElement} place
 * @param {Server.TrialInfo[]} trials
 * @param {Measure} y
 * @param {number} of  trials in all
 */
async function bestSoFar(place, trials, y, of) {
	const ink = inks();
	/** @type {number[]} */
	const best = [];
	for (const trial of trials) {
		const value = trial.vetoed ? null : y.at(trial);
		const before = best.at(-1);
		if (value == null) best.push(before ?? Number.NaN);
		else
			best.push(
				before === undefined || Number.isNaN(before)
					? value
					: (y.of.higher ? Math.max : Math.min)(before, value),
			);
	}
	await draw(
		place,
		[
			{
				mode: "lines",
				type: "scatter",
				x: best.map((_, k) => k),
				y: best,
				line: { color: ink.strong, width: 1.5, shape: "hv" },
				hovertemplate: "after %{x} trials: %{y:.4g}<extra></extra>",
			},
		],
		{
			...layoutOf(ink, { range: [0, of] }, { nticks: 3 }, [48, 6, 12, 20]),
			shapes: [
				{
					type: "rect",
					xref: "x",
					yref: "paper",
					x0: trials.length,
					x1: of,
					y0: 0,
					y1: 1,
					line: { width: 0 },
					fillcolor: ink.grid,
					opacity: 0.5,
				},
			],
		},
	);
}

/** The ends of a range and the power of ten between. @param {number[]} ends */
function logTicks([low, high]) {
	const ten = 10 ** Math.round(Math.log10(low * high) / 2);
	const apart = (high / low) ** 0.25;
	return ten > low * apart && ten < high / apart ? [low, ten, high] : [low, high];
}

/**
 * One parameter against the leading figure.
 * @param {HTMLElement} place
 * @param {Server.TrialInfo[]} trials
 * @param {Server.RangeInfo} range
 * @param {Measure} y
 * @param {{best: number | null, chosen: number | null}} which
 * @param {(number: number) => void} choose
 * @param {((low: number, high: number) => void) | null} narrow  where its range can be narrowed
 */
async function against(place, trials, range, y, which, choose, narrow) {
	const ink = inks();
	const x = (/** @type {Server.TrialInfo} */ trial) => {
		const value = trial.values[range.key] ?? range.default;
		return typeof value === "number" ? value : valueOf(value);
	};
	const known = trials.filter((trial) => y.at(trial) != null);
	const seen = known.filter(({ number }) => !number || number === which.best);
	const [all, marked] = [known, seen].map((some) => some.map((trial) => Number(y.at(trial))));
	const up = core(all, marked);
	const numbers = range.kind === "float" || range.kind === "int";
	const ends =
		numbers && range.low !== null && range.high !== null ? [range.low, range.high] : null;
	const more = ends && !range.log ? (ends[1] - ends[0]) * 0.04 : 0;
	const across = !ends
		? { type: "category" }
		: range.log
			? {
					type: "log",
					range: ends.map((end, k) => Math.log10(end) + (k ? 0.04 : -0.04)),
					tickvals: logTicks(ends),
					ticktext: logTicks(ends).map(valueOf),
				}
			: { range: [ends[0] - more, ends[1] + more] };
	await draw(
		place,
		[
			points(known, x, y.at, ink, 4, "trial %{customdata}<br>%{x:.4g}: %{y:.4g}<extra></extra>"),
			...marks(known, which, x, y.at, ink),
		],
		{
			...layoutOf(ink, { nticks: 4, ...across }, { range: up, nticks: 4 }, [40, 4, 10, 22]),
			dragmode: narrow && ends ? "select" : false,
			selectdirection: "h",
		},
	);
	onClick(place, choose);
	const figure = /** @type {any} */ (place);
	figure.removeAllListeners?.("plotly_selected");
	if (narrow && ends)
		figure.on("plotly_selected", (/** @type {any} */ event) => {
			const chosen = event?.range?.x;
			if (chosen) narrow(Math.max(ends[0], chosen[0]), Math.min(ends[1], chosen[1]));
		});
}

/** @import { Measure } from "./overview.js" */

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
