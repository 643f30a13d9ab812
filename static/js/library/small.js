/** A kept run in small, and runs side by side: what of them is drawn. */
import { chart, roundTicks } from "../elements/chart.js";
import { colourIndex, h, idTag, svg } from "../elements/dom.js";
import { parameterName, symbolOf } from "../elements/drawn.js";
import { METHODS, figure, isMethod, methodWord, templateWords, titleOf } from "./words.js";

/** Lanes that are drawn: those of the longest tracks. */
const MOST_LANES = 6;

/** Word, field, digits, and which end is the better: 0 for neither. */
const FIGURES = /** @type {const} */ ([
	["MOTA", "mota", 3, 1],
	["IDF1", "idf1", 3, 1],
	["HOTA", "hota", 3, 1],
	["OSPA, m", "ospa", 3, -1],
	["Position error, m", "position_error", 3, -1],
	["Missed", "misses", 0, -1],
	["False", "false_positives", 0, -1],
	["Identity switches", "id_switches", 0, -1],
	["Tracks", "targets", 0, 0],
]);

const PROVISIONAL = "made before the run was finished; opening it computes them again";

/** @param {unknown} text */
const quiet = (text) => h("span.q", String(text));

/** @param {Server.ChangeInfo} change */
const named = ({ key, symbol }) => h("span", { title: key }, symbolOf(symbol, ""));

/** @param {Server.KeptRunInfo} run */
const programOf = (run) => (run.older_code ? `${run.program}, older code` : run.program);

/* ---------- One run: lanes, people and OSPA over time, ways from above, facts. ---------- */

/** @param {Server.Preview} told */
export const drawn = (told) => [
	h(
		"div.pv-lanes",
		lanes(told),
		curve("People", "", told.people, told.frames, told.people_every),
		told.ospa.length > 0 && curve("OSPA", " m", told.ospa, told.frames, told.ospa_every),
	),
	h("div.pv-top", ways(told)),
	h("dl.pv-facts", ...facts(told.run)),
];

/** @param {Server.Preview} told */
function lanes({ run, frames, tracks }) {
	const longest = tracks
		.toSorted((a, b) => a.first - a.last - (b.first - b.last))
		.slice(0, MOST_LANES);
	const at = (/** @type {number} */ step) => `${((100 * step) / Math.max(1, frames)).toFixed(2)}%`;
	const more = tracks.length - longest.length;
	return h(
		"div.lines",
		{
			role: "img",
			"aria-label": `Lanes of run ${run.id}: ${tracks.length} tracks over ${frames} steps`,
		},
		h("span"),
		h(
			"span.ends",
			roundTicks([0, frames - 1], Math.min(8, frames - 1)).map(([step, text]) =>
				h("span", { "--at": at(step) }, text),
			),
		),
		...longest
			.sort((a, b) => a.first - b.first)
			.flatMap(({ id, spans }) => [
				idTag(id),
				h(
					"div",
					{ "--c": `var(--id-${colourIndex(id)})` },
					spans.map(([first, last, kind]) =>
						h("i", {
							class: kind.replace(" ", "-"),
							"--at": at(first),
							"--long": at(last + 1 - first),
						}),
					),
				),
			]),
		...(more > 0 ? [h("span"), quiet(`and ${more} more`)] : []),
	);
}

/**
 * A staircase over the steps, from zero to where it is largest.
 * @param {string} word @param {string} unit @param {number[]} values @param {number} frames
 * @param {number} every  steps that a value stands for: one of fewer steps than the run ends early
 */
function curve(word, unit, values, frames, every) {
	const most = Math.max(unit ? 0.1 : 1, ...values);
	const said = (/** @type {number} */ value) => value.toFixed(unit || value % 1 ? 2 : 0) + unit;
	const figure = chart();
	figure.show({
		label: `${word} over time, at most ${said(most)}`,
		x: { ends: [0, frames], ticks: [] },
		y: { ends: [0, most], ticks: [] },
		marks: [
			{
				kind: "steps",
				colour: "p-est",
				size: 1.25,
				points: [...values, ...values.slice(-1)].map((y, k) => {
					const x = Math.min(k * every, frames);
					return { x, y, key: x, says: `step ${x}\n${word} ${said(y)}` };
				}),
			},
		],
		margin: [0, 7, 0, 3],
	});
	return h(
		"div.crowd",
		h("span", `${word}${unit}`, h("br"), quiet(`0–${most.toFixed(unit ? 2 : 0)}`)),
		figure.element,
	);
}

/** The value below which a share of sorted ones lies. @param {number[]} sorted @param {number} share */
const quantile = (sorted, share) => sorted[Math.round(share * (sorted.length - 1))];

/** The ways of tracks from above, in the room where that is known. @param {Server.Preview} told */
function ways({ courses, room }) {
	const points = courses.flatMap((course) => course.points);
	if (!points.length) return null;
	// A stray point far away does not make all others small.
	const ends = [0, 1].map((axis) => {
		const sorted = points.map((point) => point[axis]).sort((a, b) => a - b);
		const [low, high] = [quantile(sorted, 0.005), quantile(sorted, 0.995)];
		const known = room
			? [
					[room.min[axis], room.max[axis]],
					...room.entrances.map(({ position, sigma }) =>
						[-2, 2].map((times) => position[axis] + times * sigma[axis]),
					),
				].flat()
			: [];
		return [Math.min(low, ...known), Math.max(high, ...known)];
	});
	const [[left, right], [low, high]] = ends;
	const side = Math.max(right - left, high - low, 1);
	const pad = 0.06 * side;
	return svg(
		"svg",
		{
			viewBox: [left - pad, -high - pad, right - left + 2 * pad, high - low + 2 * pad].join(" "),
			role: "img",
			"aria-label": "Ways from above",
		},
		room && outline(room),
		courses.map(({ id, points: way }) => {
			const [x, y] = way[way.length - 1];
			return svg(
				"g",
				{ "--c": `var(--id-${colourIndex(id)})` },
				svg("polyline", { points: way.map(([u, v]) => `${u},${-v}`).join(" ") }),
				svg("circle", { cx: x, cy: -y, r: side / 60 }),
			);
		}),
	);
}

/** The volume and the entrances from above. @param {Server.RoomInfo} room */
const outline = ({ min, max, entrances }) => [
	svg("rect", { x: min[0], y: -max[1], width: max[0] - min[0], height: max[1] - min[1] }),
	...entrances.map(({ position, sigma }) =>
		svg("ellipse", { cx: position[0], cy: -position[1], rx: 2 * sigma[0], ry: 2 * sigma[1] }),
	),
];

/** @param {Server.KeptRunInfo} run */
function facts(run) {
	const note = h("input.addnote", {
		"aria-label": "Note",
		placeholder: "add a note",
		value: run.note,
	});
	const marked = (/** @type {string} */ text) => (run.provisional ? quiet(text) : text);
	const error = figure(run.position_error);
	/** @type {[Child, Child[]][]} */
	const rows = [
		...METHODS.map(
			([key, word]) => /** @type {[Child, Child[]]} */ ([word, [methodWord(run[key])]]),
		),
		...run.changes
			.filter(({ key }) => !isMethod(key))
			.map(
				(change) =>
					/** @type {[Child, Child[]]} */ ([
						named(change),
						[quiet(change.default && `${methodWord(change.default)} → `), methodWord(change.value)],
					]),
			),
	];
	if (run.corrected) rows.push(["Corrections of a person", [run.corrected]]);
	if (run.provisional) rows.push(["Figures", [`provisional: ${PROVISIONAL}`]]);
	rows.push(
		["Missed", [marked(figure(run.misses, 0))]],
		["False", [marked(figure(run.false_positives, 0))]],
		["Identity switches", [marked(figure(run.id_switches, 0))]],
		["Position error", [marked(run.position_error === null ? error : `${error} m`)]],
		["Seed", [run.seed]],
		["Program", [programOf(run)]],
	);
	return [
		h("dt.vh", "Note"),
		h("dd.whole", note),
		...rows.flatMap(([word, value]) => [h("dt", word), h("dd", value)]),
	];
}

/* ---------- Runs side by side: their figures, the best of each bold, and what differs. ---------- */

/** @typedef {[Child, Child[]]} Row  a word, and a value for each run */

/**
 * @param {Server.KeptRunInfo[]} runs
 * @param {Server.Schema | null} schema
 * @returns {Child[]} the table of what differs, and what is alike, folded
 */
export function comparison(runs, schema) {
	/** @type {(rows: Row[]) => Child[]} */
	const lines = (rows) =>
		rows.map(([word, values]) =>
			h(
				"tr",
				h("td", word),
				values.map((value) => h("td.num", value)),
			),
		);
	const figures = FIGURES.map((one) => sideBySide(runs, one));
	if (runs.some(({ provisional }) => provisional))
		figures.push(["Figures", runs.map(({ provisional }) => (provisional ? PROVISIONAL : ""))]);
	const all = causes(runs, schema);
	const alike = all.filter(([, values]) => new Set(values).size === 1);
	const differing = all.filter((row) => !alike.includes(row));
	return [
		h(
			"table",
			{ "aria-label": "Runs side by side" },
			h(
				"thead",
				h(
					"tr",
					h("th", { scope: "col" }, "What"),
					runs.map((run) => h("th.num", { scope: "col" }, titleOf(run))),
				),
			),
			h("tbody", lines(figures)),
			h("tbody", lines(differing)),
		),
		alike.length > 0 &&
			h(
				"details",
				h("summary", `${alike.length} equal`),
				h(
					"table",
					{ "aria-label": "Equal in all of them" },
					h("tbody", lines(alike.map(([word, [value]]) => [word, [value]]))),
				),
			),
	];
}

/**
 * What runs were made with: methods, corrections, program, and each value that one of them changed.
 * @param {Server.KeptRunInfo[]} runs @param {Server.Schema | null} schema
 * @returns {[Child, string[]][]}
 */
function causes(runs, schema) {
	const changes = new Map(runs.flatMap((run) => run.changes).map((one) => [one.key, one]));
	const change = (/** @type {Server.KeptRunInfo} */ run, /** @type {string} */ key) =>
		run.changes.find((one) => one.key === key);
	return [
		...METHODS.map(
			([key, word]) =>
				/** @type {[Child, string[]]} */ ([word, runs.map((run) => methodWord(run[key]))]),
		),
		...[...changes.values()]
			.filter(({ key }) => !isMethod(key))
			.map((one) => {
				const known = schema?.parameters.find(({ key }) => key === one.key);
				const word = known ? parameterName(known) : methodWord(one.key);
				return /** @type {[Child, string[]]} */ ([
					h("span", word, quiet(known?.unit ? ` ${known.unit}` : "")),
					runs.map((run) => methodWord(change(run, one.key)?.value ?? one.default)),
				]);
			}),
		["Colour templates", templateWords(runs)],
		["Seed", runs.map(({ seed }) => String(seed))],
		["Corrections of a person", runs.map(({ corrected }) => String(corrected))],
		["Program", runs.map(programOf)],
	];
}

/**
 * A figure of several runs: provisional ones are shown, not compared.
 * @param {Server.KeptRunInfo[]} runs @param {(typeof FIGURES)[number]} figure
 * @returns {[string, Child[]]}
 */
function sideBySide(runs, [word, key, digits, sign]) {
	const provisional = (/** @type {Server.KeptRunInfo} */ run) =>
		key !== "targets" && run.provisional;
	const there = runs
		.filter((run) => sign && run[key] !== null && !provisional(run))
		.map((run) => sign * Number(run[key]));
	const best = there.length > 1 ? Math.max(...there) : null;
	const alone = there.filter((value) => value === best).length === 1;
	return [
		word,
		runs.map((run) => {
			const text = figure(run[key], digits);
			if (provisional(run)) return quiet(`(${text})`);
			const wins = alone && run[key] !== null && sign * Number(run[key]) === best;
			return wins ? h("b.top1", text) : text;
		}),
	];
}
