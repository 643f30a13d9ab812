/** How the figures of a study are drawn by Plotly: colours, axes, points and marks of trials. */
import { fill, h } from "../../elements/dom.js";

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
function plotly() {
	reading ??= (async () => {
		document.head.append(...STYLED.map((id) => h("meta", { id, class: "no-inline-styles" })));
		// By name, for nothing of it is known to the compiler.
		const address = "/plotly/plotly.min.js";
		await import(address);
		return /** @type {any} */ (window).Plotly;
	})().catch(() => {
		reading = null;
		throw new Error("The figures could not be read.");
	});
	return reading;
}

/** The colours of the page as they are now. */
export function inks() {
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
export function layoutOf(ink, x, y, [left, top, right, bottom]) {
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
export async function draw(place, traces, layout) {
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
export function points(trials, x, y, ink, size, says) {
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
export function marks(trials, { best, chosen }, x, y, ink, note, middle = Infinity) {
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
export function core(values, seen) {
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
export const upright = (place, title, better) =>
	7 * (title.length + better.length + 2) < place.clientHeight - 40 ? `${title}, ${better}` : title;

/** @param {any} place @param {(number: number) => void} choose */
export function onClick(place, choose) {
	place.removeAllListeners?.("plotly_click");
	place.on?.("plotly_click", (/** @type {any} */ event) => {
		const number = event.points[0]?.customdata;
		if (number !== undefined) choose(number);
	});
}
