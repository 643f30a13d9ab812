/** The figures of a study, drawn by Plotly; the table says the same in words. */
import { fill, h } from "../elements/dom.js";
import { figureOf, titledOf, valueOf } from "./words.js";

/** Trials that are shown against each parameter: a place for each. */
export const MOST_PARAMETERS = 6;

/** @typedef {{name: string, of: Server.ObjectiveInfo, at: (trial: Server.TrialInfo) => number | null | undefined}} Measure */

/**
 * Where elements of these names stand Plotly writes no style sheets of its own, which the page's
 * policy would not let it: its own, of which css/study.css has what is needed, and one for maps.
 */
const STYLED = [
	"plotly.js-style-global",
	"9f215cf04c5486422605d13261cb87401f4e7763b6296af81e98efbc0130da53",
];

/** @type {Promise<any> | null} */
let reading = null;

/** Read when the first figure is wanted: it is larger than all else of the page. */
export function plotly() {
	reading ??= new Promise((resolve, reject) => {
		const script = h("script", { src: "/plotly/plotly.min.js" });
		script.onload = () => resolve(/** @type {any} */ (window).Plotly);
		script.onerror = () => {
			reading = null;
			reject(new Error("The figures could not be read."));
		};
		document.head.append(
			...STYLED.map((id) => h("meta", { id, class: "no-inline-styles" })),
			script,
		);
	});
	return reading;
}

/** The colours of the page as they are now. */
function inks() {
	const style = getComputedStyle(document.documentElement);
	const of = (/** @type {string} */ name) => style.getPropertyValue(`--${name}`).trim();
	return {
		strong: of("ink-1"),
		plain: of("ink-2"),
		faint: of("ink-3"),
		grid: of("p-grid"),
		accent: of("accent"),
		ground: of("bg-1"),
		size: Number.parseFloat(of("fs-0")) || 10,
		font: getComputedStyle(document.body).fontFamily,
	};
}

/** @param {ReturnType<typeof inks>} ink @param {object} x @param {object} y @param {number[]} margin */
function layoutOf(ink, x, y, [left, top, right, bottom]) {
	const axis = {
		gridcolor: ink.grid,
		zeroline: false,
		linecolor: ink.grid,
		tickfont: { size: ink.size, color: ink.faint },
		title: { font: { size: ink.size + 1, color: ink.plain } },
		nticks: 6,
		exponentformat: "power",
		minexponent: 3,
		fixedrange: true,
	};
	return {
		font: { family: ink.font, size: ink.size + 1, color: ink.plain },
		paper_bgcolor: ink.ground,
		plot_bgcolor: ink.ground,
		margin: { l: left, t: top, r: right, b: bottom },
		xaxis: { ...axis, ...x },
		yaxis: { ...axis, ...y },
		showlegend: false,
		hoverlabel: {
			bgcolor: ink.ground,
			bordercolor: ink.faint,
			font: { size: ink.size + 1, color: ink.strong },
		},
		hovermode: "closest",
		dragmode: false,
	};
}

/** Plotly follows the window, not its place. @type {ResizeObserver | null} */
let sizes = null;

const SETTINGS = { displayModeBar: false, responsive: true };

/**
 * @param {HTMLElement} place
 * @param {object[]} traces
 * @param {object} layout
 */
async function draw(place, traces, layout) {
	const Plotly = await plotly();
	if (!place.classList.contains("js-plotly-plot")) fill(place); // what was said in its place
	await Plotly.react(place, traces, layout, SETTINGS);
	sizes ??= new ResizeObserver((changes) => {
		for (const { target, contentRect: now } of changes) {
			const drawn = /** @type {any} */ (target)._fullLayout;
			if (!drawn || !now.width || !now.height) continue;
			if (Math.abs(drawn.width - now.width) > 1 || Math.abs(drawn.height - now.height) > 1)
				void Plotly.Plots.resize(target);
		}
	});
	sizes.observe(place);
}

/** Nothing is drawn there any more. @param {Element} place */
export function clear(place) {
	sizes?.unobserve(place);
	/** @type {any} */ (window).Plotly?.purge(place);
	place.classList.remove("js-plotly-plot");
	fill(place);
}

/**
 * Points of trials: older ones fainter.
 * @param {Server.TrialInfo[]} trials
 * @param {(trial: Server.TrialInfo) => any} x
 * @param {(trial: Server.TrialInfo) => any} y
 * @param {ReturnType<typeof inks>} ink
 * @param {number} size
 * @param {string} says
 */
function points(trials, x, y, ink, size, says) {
	return {
		mode: "markers",
		type: "scatter",
		x: trials.map(x),
		y: trials.map(y),
		customdata: trials.map(({ number }) => number),
		marker: {
			size,
			color: ink.faint,
			opacity: trials.map((_, k) => 0.35 + (0.5 * k) / Math.max(trials.length, 1)),
		},
		hovertemplate: says,
	};
}

/**
 * The default a diamond, the best a ringed dot, the chosen one a ring.
 * @param {Server.TrialInfo[]} trials
 * @param {{best: number | null, chosen: number | null}} which
 * @param {(trial: Server.TrialInfo) => any} x
 * @param {(trial: Server.TrialInfo) => any} y
 * @param {ReturnType<typeof inks>} ink
 * @param {(trial: Server.TrialInfo) => string} [note]
 * @param {number} [middle]  of the axis: what is beyond it has its note to the left
 */
function marks(trials, { best, chosen }, x, y, ink, note, middle = Infinity) {
	const of = (/** @type {number | null} */ number) =>
		trials.filter((trial) => trial.number === number);
	const trace = (
		/** @type {Server.TrialInfo[]} */ found,
		/** @type {object} */ marker,
		/** @type {string} */ word,
	) => ({
		mode: note ? "markers+text" : "markers",
		type: "scatter",
		x: found.map(x),
		y: found.map(y),
		customdata: found.map(({ number }) => number),
		text: found.map((trial) => (note ? `${word} ${note(trial)}` : "")),
		textposition: found.map((trial) => (x(trial) > middle ? "top left" : "top right")),
		textfont: { size: ink.size + 1, color: ink.strong },
		marker,
		hovertemplate: `${word}<extra></extra>`,
		cliponaxis: false,
	});
	const diamond = { symbol: "diamond", color: ink.ground, line: { color: ink.strong, width: 1.5 } };
	const dot = { color: ink.accent, line: { color: ink.ground, width: 1.5 } };
	const ring = {
		symbol: "circle-open",
		color: ink.accent,
		line: { color: ink.accent, width: 1.5 },
	};
	const large = note ? 11 : 8;
	const gain = best !== null && best !== 0;
	return [
		trace(of(0), { ...diamond, size: large }, "default"),
		...(gain ? [trace(of(best), { ...dot, size: large }, `best, trial ${best}:`)] : []),
		...(chosen !== null
			? [{ ...trace(of(chosen), { ...ring, size: large + 6 }, "chosen"), text: [] }]
			: []),
	];
}

/** A little beyond what is shown. @param {number[]} values */
function room(values) {
	const [low, high] = [Math.min(...values), Math.max(...values)];
	const more = (high - low || Math.abs(high) || 1) * 0.08;
	return [low - more, high + more];
}

/**
 * The middle half of the values and as much again, so that a lost trial does not flatten the rest;
 * what has to be seen is in it.
 * @param {number[]} values
 * @param {number[]} seen
 */
function core(values, seen) {
	const sorted = [...values].sort((a, b) => a - b);
	const at = (/** @type {number} */ share) =>
		sorted[Math.round(share * (sorted.length - 1))] ?? Number.NaN;
	const [low, high] = [at(0.25), at(0.75)];
	const reach = 3 * (high - low) || Infinity;
	const inside = sorted.filter((value) => value >= low - reach && value <= high + reach);
	return room([...inside, ...seen]);
}

/** What stands along an upright axis: what is better, too, where it is long enough for that.
 * @param {HTMLElement} place @param {string} title @param {string} better */
const upright = (place, title, better) =>
	7 * (title.length + better.length + 2) < place.clientHeight - 40 ? `${title}, ${better}` : title;

/**
 * The trials by two figures, with those that nothing beats in both.
 * @param {HTMLElement} place
 * @param {Server.TrialInfo[]} trials
 * @param {Measure} x
 * @param {Measure} y
 * @param {{best: number | null, chosen: number | null}} which
 * @param {(number: number) => void} choose
 */
export async function scatter(place, trials, x, y, which, choose) {
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
	const note = (/** @type {Server.TrialInfo} */ trial) => figureOf(y.at(trial), y.of);
	await draw(
		place,
		[
			points(known, x.at, y.at, ink, 6, says),
			{
				mode: "lines+markers",
				type: "scatter",
				x: front.map(x.at),
				y: front.map(y.at),
				customdata: front.map(({ number }) => number),
				line: { color: ink.accent, width: 1.25, shape: x.of.higher === y.of.higher ? "vh" : "hv" },
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

/** @param {any} place @param {(number: number) => void} choose */
function onClick(place, choose) {
	place.removeAllListeners?.("plotly_click");
	place.on?.("plotly_click", (/** @type {any} */ event) => {
		const number = event.points[0]?.customdata;
		if (number !== undefined) choose(number);
	});
}

/**
 * The best figure over the trials; what is still to come stays empty.
 * @param {HTMLElement} place
 * @param {Server.TrialInfo[]} trials
 * @param {Measure} y
 * @param {number} of  trials in all
 */
export async function bestSoFar(place, trials, y, of) {
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
export async function against(place, trials, range, y, which, choose, narrow) {
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
