/** What the panels beside the pictures tell: the shown step, events, figures and runs. */
import { h, idTag, rate, show } from "../elements/dom.js";
import { drawnTable, fixed, line, nothing, parameterName, quiet } from "../elements/drawn.js";
import { getJson } from "../state/api.js";
import { eventsNow, resultOf, scoresOf, trueCount } from "../state/events.js";

/** @typedef {Readonly<PageState>} State */

const BOX = "#Left, top, width, height  px";

/** @param {number[]} values  metres */
const vector = (values) => values.map((value) => fixed(value, 2)).join("  ");

/** @param {Box | null} box */
const sides = (box) => box && box.map(Math.round).join("  ");

/** A value of a parameter as a person reads it; methods and choices by their own names. @param {any} value */
const valueOf = (value) =>
	typeof value === "number"
		? show(value).replace("-", "−")
		: typeof value === "boolean"
			? value
				? "on"
				: "off"
			: (value ?? null);

/* ---------- The shown step: the people in 3D, each camera's view of them, the curves' values. */

/** What OSPA and GOSPA are called. @type {["ospa" | "ospa_localisation" | "ospa_cardinality" | "gospa", string][]} */
const MEASURES = [
	["ospa", "OSPA"],
	["ospa_localisation", "OSPA, location"],
	["ospa_cardinality", "OSPA, number"],
	["gospa", "GOSPA"],
];

/**
 * The series of the shown run and of the one beside it with the shown step's own values: those of
 * a long recording stand for several steps each, so that step is asked for.
 * @param {State} state
 * @returns {Promise<(Server.EvaluationSeries | null)[]>}
 */
export async function seriesOf(state) {
	const { series, reference } = scoresOf(state) ?? { series: null, reference: null };
	return Promise.all(
		[series, reference].map((one) =>
			one && one.stride > 1
				? getJson(`/api/evaluation/series?of=${one.of}&first=${state.shown}&last=${state.shown}`)
				: one,
		),
	);
}

/** @param {State} state @param {(Server.EvaluationSeries | null)[]} series */
export function stepTables(state, series) {
	const { result: painted, basis, names } = state;
	// Another run is shown: its step is on the way, and takes the place of this one.
	if (painted?.computed && painted.run !== basis) return null;
	const result = resultOf(state);
	if (!result)
		return nothing(
			"Nothing is computed at this step",
			"Where people are, what each camera saw of them and the curves' values stand here.",
		);
	const errors = new Map(result.truth.map(({ track, error }) => [track, error]));
	const unowned = result.cameras.flatMap(({ name, measurements }) =>
		measurements.flatMap((box, k) =>
			box.track === null
				? [
						[
							name,
							`box ${k + 1}`,
							fixed(box.score, 2),
							box.nearest === null ? "no track in this picture" : idTag(box.nearest),
							fixed(box.sigmas, 2),
							fixed(box.gate, 2),
							sides(box.box),
						],
					]
				: [],
		),
	);
	return [
		drawnTable(
			`People in 3D at step ${result.step}`,
			["In 3D", "#Weight", "#x, y, z  m", "#± m", "#Error  m"],
			result.tracks.map(({ id, existence, position, sigma }) => [
				[idTag(id), names[id] && ` ${names[id]}`],
				fixed(existence, 3),
				vector(position),
				vector(sigma),
				fixed(errors.get(id), 3),
			]),
			{ sorts: true },
		),
		drawnTable(
			"Tracks in the pictures",
			["Camera", "Track", "State", "#p_D", "Because", "Fed by", BOX],
			result.cameras.flatMap(({ name, tracks }) =>
				tracks.map((track) => [
					name,
					idTag(track.id),
					track.seen ? "seen" : "coasting",
					fixed(track.detection_probability, 2),
					track.hidden_by === null ? (track.reason ?? "") : `hidden by ${track.hidden_by}`,
					track.fed_by && `box ${track.source + 1}, ${fixed(100 * track.fed_by.share, 0)} % sure`,
					sides(track.box),
				]),
			),
			{ sorts: true },
		),
		unowned.length > 0 &&
			drawnTable(
				"Detections that are nobody's",
				["Camera", "Nobody's", "#Score", "Nearest track", "#σ away", "#Gate, σ", BOX],
				unowned,
				{ sorts: true },
			),
		curves(state, result, series),
	];
}

/** @param {State} state @param {Server.Step} result @param {(Server.EvaluationSeries | null)[]} series */
function curves({ sequence }, result, series) {
	const at = (/** @type {Server.EvaluationSeries | null} */ one, /** @type {"ospa"} */ name) =>
		one?.[name][Math.floor((result.step - one.first) / one.stride)];
	return drawnTable(
		"Curves at this step",
		["Measure", "#B", "#A"],
		[
			...(sequence?.has_truth ? [["People, true", trueCount(result), null]] : []),
			["People, reported", result.tracks.length, null],
			["People, expected", fixed(result.cardinality, 2), null],
			["Components", result.components, null],
			...MEASURES.flatMap(([name, word]) => {
				const [b, a] = series.map((one) => at(one, /** @type {"ospa"} */ (name)));
				return b === undefined ? [] : [[`${word}  m`, fixed(b, 3), fixed(a, 3)]];
			}),
			...result.cameras.flatMap(({ name, information }) =>
				Object.entries(information).map(([word, value]) => [
					`${name}, ${word}`,
					show(Number(value.toPrecision(4))),
					null,
				]),
			),
		],
	);
}

/* ---------- What happens to the tracks; each can be gone to. */

/** Rows of the table of events; more are counted. */
const MOST_EVENTS = 500;

/** @param {State} state @param {unknown} _ @param {Actions} actions */
export function eventTable(state, _, actions) {
	const { eventKind, timeline, fps } = state;
	const identity = identityOf(state);
	const go = (/** @type {number} */ step, /** @type {number} */ id) =>
		h(
			"button.btn",
			{ "aria-label": `Go to step ${step}`, onclick: () => actions.go(`${step} ${id}`) },
			step,
		);
	if (eventKind === "doubt") {
		if (identity?.score === null || !identity) return checked(state, actions);
		return [
			line(
				`IDF1 is estimated ${fixed(identity.score, 3)} (${between(identity)}); Compare tells by what. `,
				quiet(identity.warning),
			),
			identity.doubts.length
				? drawnTable(
						"Doubtful moments",
						["#Step", "#Time  s", "Doubtful, the most doubtful first", "Tracks"],
						identity.doubts
							.slice(0, MOST_EVENTS)
							.map(({ step, ids, why }) => [
								go(step, ids[0]),
								fixed(step / fps, 2),
								why,
								ids.map(idTag),
							]),
						{ sorts: true, goes: true },
					)
				: line("All ways to look agree: no moment is doubtful."),
		];
	}
	const events = eventsNow(state);
	if (!events.length)
		return nothing(
			"No such event",
			"Births, deaths, switches of identity and long misses are listed as they are found.",
		);
	/** @type {Map<string, string>} */
	const why = new Map([
		...(timeline?.decisions ?? []).map(
			({ step, track, kind, words }) => /** @type {const} */ ([`${step} ${track} ${kind}`, words]),
		),
		...(identity?.doubts ?? []).map(
			(doubt) =>
				/** @type {const} */ ([`${doubt.step} ${doubt.ids[0]} doubt`, `doubtful: ${doubt.why}`]),
		),
	]);
	const more = events.length - MOST_EVENTS;
	return [
		drawnTable(
			"Events",
			["#Step", "#Time  s", "Event", "Track"],
			events
				.slice(0, MOST_EVENTS)
				.map(({ step, id, kind }) => [
					go(step, id),
					fixed(step / fps, 2),
					why.get(`${step} ${id} ${kind}`) ?? kind,
					idTag(id),
				]),
			{ sorts: true, goes: true },
		),
		more > 0 && line(`and ${more} more`),
	];
}

/* ---------- How well people are told apart, as far as the recording alone can say. */

/** Below this mean overlap of a camera's boxes with the others' people a figure means little: the
 * cameras do not speak of the same people. */
const LOW_OVERLAP = 0.3;

/** What was found of the shown run. @param {State} state */
const identityOf = ({ identity, basis }) => (identity?.run === basis ? identity : null);

/** @param {Server.IdentityInfo} identity */
const between = ({ low, high }) => `${fixed(low, 3)} … ${fixed(high, 3)}`;

/** The estimate with what it rests on; else how to have it. @param {State} state @param {Actions} actions */
function checked(state, actions) {
	const { identity: now } = state;
	const check = (/** @type {"start" | "stop"} */ what, /** @type {string} */ word) =>
		h("button.btn", { onclick: () => actions.checkIdentities(what) }, word);
	if (now?.state === "looking")
		return [
			line(
				"Looking backwards in time and without each camera: ",
				now.total ? `${fixed((100 * now.done) / now.total, 0)} % ` : "beginning ",
				check("stop", "Stop"),
			),
		];
	const found = identityOf(state);
	if (found?.score === null || !found)
		return [
			line(
				found?.state === "failed" && `${found.error} `,
				"Without truth: are people still the same backwards in time and without each camera? It takes about as long as one run for each of these. ",
				check("start", "Check identities"),
			),
		];
	return [
		drawnTable(
			"Identity without truth",
			["Without truth", "#IDF1", "Which is"],
			[
				[
					"IDF1, estimated",
					fixed(found.score, 3),
					`${between(found)} in nine of ten runs by which it was calibrated`,
				],
				["backwards in time", fixed(found.backwards, 3), "IDF1 by the run as it is"],
				...found.witnesses.map(({ camera, agreed, overlap }) => [
					`without ${camera}`,
					fixed(agreed, 3),
					`its boxes overlap the others’ people by ${fixed(overlap, 2)}${
						overlap !== null && overlap < LOW_OVERLAP
							? ": they speak of other people, trust nothing here"
							: ""
					}`,
				]),
			],
		),
		line(quiet(found.warning)),
	];
}

/* ---------- Parameters that differ between two runs. */

/** @param {State} state @param {string} key  of a parameter; nothing is found for a method's */
const parameterOf = ({ schema }, key) =>
	schema?.parameters.find((parameter) => parameter.key === key);

/** @param {State} state @param {string} key */
function nameOf(state, key) {
	const known = parameterOf(state, key);
	return known ? parameterName(known) : key.replaceAll("_", " ");
}

/* ---------- The shown run, B, against the truth, beside A: the pinned run or the one before. */

/** @type {Record<Server.DifferenceInfo["verdict"], string>} */
const VERDICTS = {
	better: "▲ better",
	worse: "▼ worse",
	same: "= same",
	different: "≠ different",
	undefined: "–",
};

/**
 * Whose figures they are, and how much of the parameters was changed for them.
 * @param {string} words @param {number} changes @param {boolean} partial
 */
const sideOf = (words, changes, partial) =>
	`${words}, ${changes ? `${changes} change${changes > 1 ? "s" : ""}` : "default parameters"}${partial ? ", not finished" : ""}`;

/** @param {{label: string, unit: string, settings: string}} figure @param {string | undefined} help */
const measureOf = ({ label, unit, settings }, help) =>
	h("span", { title: `${help ?? ""}\n${settings}`.trim() }, label, quiet(unit && ` ${unit}`));

/** @param {State} state @param {Server.Comparison | null} comparison @param {Actions} actions */
export function compareTables(state, comparison, actions) {
	const { sequence, scores, basis, every } = state;
	const identity = checked(state, actions);
	if (!sequence?.has_truth)
		return [
			...identity,
			line(
				quiet(
					`${sequence?.name} has no file of true positions, so its tracks cannot be scored; one can be named in its sequence.toml.`,
				),
			),
		];
	if (!scores)
		return nothing("Not scored yet", "The tracks are set against the truth while the run goes on.");
	const { evaluation, series } = scores;
	const shown = series.run === basis ? "this run" : "the run before, this one is being scored";
	const notes = [[series.gate, series.cost].join(" · "), ...evaluation.notes].map((note) =>
		line(note),
	);
	if (!comparison)
		return [
			line(
				h("b", "B"),
				` ${sideOf(shown, evaluation.changes, evaluation.partial)}`,
				" · no run to compare with: pin this one, or change a parameter",
			),
			drawnTable(
				"Figures",
				["Measure", "#B"],
				evaluation.figures
					.filter(({ headline }) => every || headline)
					.map((figure) => [measureOf(figure, figure.help), fixed(figure.value, figure.digits)]),
			),
			...notes,
			...identity,
		];
	const { a, b, against, steps, rows, parameters } = comparison;
	const helps = new Map(evaluation.figures.map(({ name, help }) => [name, help]));
	const count = (/** @type {Server.ComparedRun} */ { changed }) => Object.keys(changed).length;
	return [
		line(
			h("b", "A"),
			` ${sideOf(against === "pinned" ? "pinned run" : "run before", count(a), a.partial)} `,
			h("b", "B"),
			` ${sideOf(shown, count(b), b.partial)} · ${steps} steps`,
		),
		drawnTable(
			"Figures",
			["Measure", "#A", "#B", "#Difference", "B is"],
			rows
				.filter(({ headline }) => every || headline)
				.map((row) => [
					measureOf(row, helps.get(row.name)),
					quiet(fixed(row.a, row.digits)),
					fixed(row.b, row.digits),
					row.comparable ? fixed(row.difference, row.digits, true) : null,
					row.comparable
						? h("span", { class: row.verdict }, VERDICTS[row.verdict])
						: "other settings",
				]),
		),
		parameters.length > 0 &&
			drawnTable(
				"Parameters that differ",
				["B differs in", "#A", "#B"],
				parameters.map((one) => [nameOf(state, one.key), quiet(valueOf(one.a)), valueOf(one.b)]),
				{ sorts: true },
			),
		...notes,
		...identity,
	];
}

/* ---------- The runs since the server was started, each with the way back to it. */

/** @type {Record<Server.RunInfo["state"], string>} */
const PHASES = {
	idle: "ready",
	computing: "computing",
	done: "computed",
	failed: "failed",
	cancelled: "partial",
};

/** @param {State} state @param {Server.PastRuns} told @param {Actions} actions */
export function runTable({ run: now }, { runs }, actions) {
	if (!runs.length)
		return nothing("No run yet", "What is computed is listed here, and can be taken up again.");
	return drawnTable(
		"Runs",
		["Run", "Sequence", "Methods", "State", "#Steps/s", "#Changes", "#"],
		runs.map((run) => {
			const current = run.key === now?.key;
			const words = run.state === "computing" && !current ? "overtaken" : PHASES[run.state];
			const speed = run.steps_per_second;
			return [
				run.number,
				[h("span", run.sequence), " ", quiet(run.at)],
				[quiet(`${run.single_view} ·`), " ", quiet(run.fusion_method)],
				run.done >= run.total ? words : `${words} ${run.done}/${run.total}`,
				speed ? rate(speed) : null,
				run.changes,
				current
					? quiet("current")
					: run.same_recording
						? h(
								"button.btn",
								{
									"aria-label": `Use the parameters of run ${run.number} again`,
									onclick: () => actions.useAgain(String(run.number)),
								},
								"use again",
							)
						: quiet("another sequence"),
			];
		}),
		{ sorts: true },
	);
}
