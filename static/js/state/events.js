/** Tracks and what happens to them, as the lanes, the tables and the keys need them. */

/** What tells results of one run apart: before smoothing and after it they are of other people. @param {{run: string, revision: number}} shown */
export const versionOf = ({ run, revision }) => `${run || "none"} ${revision}`;

/** Of the run that the server shows. @param {Readonly<PageState>} state */
export const shownVersion = ({ basis, revision }) => versionOf({ run: basis, revision });

/**
 * Whether what is drawn is of an older run than the one that is asked for, which may have no step
 * yet; after a failure the last good one is meant to be seen.
 * @param {Readonly<PageState>} state
 * @param {string | null | undefined} of  the run that it is drawn from
 */
export const isOld = ({ run }, of) =>
	Boolean(of && run?.key && run.key !== of && run.state !== "failed");

/** The scores, where they are of the run that is shown. @param {Readonly<PageState>} state */
export const scoresOf = ({ scores, basis }) => (scores?.series.run === basis ? scores : null);

/**
 * The shown step's result, where it is of the run that is shown and computed.
 * @param {Readonly<PageState>} state
 */
export const resultOf = ({ result, basis }) =>
	result?.run === basis && result.computed ? result : null;

/**
 * How many people the truth counts: those it does not ask for are neither missed nor false.
 * @param {Server.Step} result
 */
export const trueCount = ({ truth }) => truth.filter(({ valid }) => valid).length;

/**
 * What a layer's key makes of it: on in pictures and in 3D, then off in both, then as it was where
 * the two differed.
 * @param {(boolean | undefined)[]} now  in the pictures and in 3D; undefined where there is none
 * @param {(boolean | undefined)[] | undefined} mixed  how the two differed, if ever
 * @returns {(boolean | undefined)[]}
 */
export function nextLayers(now, mixed) {
	const known = now.filter((on) => on !== undefined);
	if (!known.some(Boolean)) return mixed ?? now.map((on) => (on === undefined ? on : true));
	const all = known.every(Boolean);
	return now.map((on) => (on === undefined ? on : !all));
}

/** Whether only the selected track is shown. @param {Readonly<PageState>} state */
export const isAlone = ({ selection, layers3d }) => selection !== null && layers3d.others === false;

/**
 * Events of the shown run that somebody wants to see, by step and track; switches are among them
 * where there is truth, doubts where identities were checked.
 * @param {Readonly<PageState>} state
 */
export function eventsNow(state) {
	const { timeline, eventKind } = state;
	/** @type {LaneEvent[]} */
	const events = (timeline?.events ?? []).map(([step, id, kind]) => ({ step, id, kind }));
	for (const { step, track } of scoresOf(state)?.series.switches ?? [])
		events.push({ step, id: track, kind: "switch" });
	const { identity, basis } = state;
	if (identity?.run === basis)
		for (const { step, ids } of identity.doubts) events.push({ step, id: ids[0], kind: "doubt" });
	return events
		.filter(({ kind }) => !eventKind || kind === eventKind)
		.sort((a, b) => a.step - b.step || a.id - b.id);
}

/**
 * What smoothing decided of a track, nearest to a step first.
 * @param {Readonly<PageState>} state @param {number} id @param {number} step
 */
export const decisionsOf = ({ timeline }, id, step) =>
	(timeline?.decisions ?? [])
		.filter(({ track }) => track === id)
		.sort((a, b) => Math.abs(a.step - step) - Math.abs(b.step - step));

/**
 * The nearest event after or before a step.
 * @param {LaneEvent[]} events  by step
 * @param {number} step
 * @param {-1 | 1} direction
 */
export const nextEvent = (events, step, direction) =>
	(direction > 0 ? events : [...events].reverse()).find(
		(event) => (event.step - step) * direction > 0,
	);

/**
 * What a camera's method says of the people in its picture: "3 and 5 occluded, 7 new".
 * @param {Server.CameraEvent[]} events
 */
export const viewWords = (events) =>
	events
		.map(({ kind, labels }) => `${labels.join(", ").replace(/, (?!.*,)/, " and ")} ${kind}`)
		.join(", ");

const CANDIDATES = "candidates";
const DROPPED = "dropped for ";

/**
 * What became of the places that a camera's method looked at more closely:
 * "9 candidates, 6 dropped for colour, 2 for shape", or "none dropped". Nothing where it has no gates.
 * @param {Record<string, number>} information  of the method, by name
 */
export function gateWords(information) {
	const all = information[CANDIDATES];
	if (all === undefined) return [];
	const fell = Object.entries(information)
		.filter(([name, count]) => name.startsWith(DROPPED) && count > 0)
		.map(([name, count], k) => `${count} ${k ? "" : "dropped "}for ${name.slice(DROPPED.length)}`);
	const rest = all && !fell.length ? ["none dropped"] : fell;
	return [[`${all} candidate${all === 1 ? "" : "s"}`, ...rest].join(", ")];
}

/**
 * Tracks in the order of the lanes.
 * @param {Server.TrackLife[]} tracks
 * @param {"longest" | "born"} order  longest: people first, ghosts of a few steps last
 */
export function ordered(tracks, order) {
	const length = (/** @type {Server.TrackLife} */ { first, last }) => last - first;
	return [...tracks].sort(
		(a, b) => (order === "longest" ? length(b) - length(a) : a.first - b.first) || a.id - b.id,
	);
}

/**
 * What a track is doing at a step.
 * @param {Server.TrackLife} track @param {number} step
 * @returns {"not yet" | "ended" | "seen" | "coasting" | "lost"} lost: not reported at this step,
 * but later again
 */
export function stateAt({ first, last, spans }, step) {
	if (step < first) return "not yet";
	if (step > last) return "ended";
	const kind = spans.find(([from, to]) => step >= from && step <= to)?.[2];
	return kind === "long miss" ? "coasting" : (kind ?? "lost");
}
