/** The figures of a study; the table says the same in words. */
import { core, draw, inks, layoutOf, marks, onClick, points, upright } from "./plotting.js";
import { figureOf, titledOf, valueOf } from "../words.js";

/** Trials that are shown against each parameter: a place for each. */
export const MOST_PARAMETERS = 6;

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
