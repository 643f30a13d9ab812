// @ts-check
/**
 * What happens to tracks, as a list of steps to jump to.
 */

/** Steps without a box from any camera that make a miss long, in seconds. */
export const LONG_MISS = 1.5;

/**
 * @param {TrackLane} track
 * @param {number} fps
 * @returns {[number, number][]} spans, inclusive
 */
export function longMisses({ spans }, fps) {
	return spans.flatMap(([from, to, kind]) =>
		kind === "coasting" && to - from + 1 >= LONG_MISS * fps ? [/** @type {[number, number]} */ ([from, to])] : [],
	);
}

/**
 * @param {TrackLane[]} tracks
 * @param {{fps: number, done: number, switches?: Switch[]}} run
 * @returns {LaneEvent[]} by step, then id
 */
export function eventsOf(tracks, { fps, done, switches = [] }) {
	/** @type {LaneEvent[]} */
	const events = [];
	for (const track of tracks) {
		if (track.first > 0) events.push({ step: track.first, id: track.id, kind: "birth" });
		// A track that reaches the newest step has not ended.
		if (track.last < done - 1) events.push({ step: track.last, id: track.id, kind: "death" });
		for (const [from] of longMisses(track, fps)) events.push({ step: from, id: track.id, kind: "long miss" });
	}
	for (const { step, track } of switches) events.push({ step, id: track, kind: "switch" });
	return events.sort((a, b) => a.step - b.step || a.id - b.id);
}

/**
 * The scores, where they are of the run that is shown.
 * @param {Readonly<PageState>} state
 */
export const scoresOf = ({ scores, basis }) => (scores?.series.run === basis ? scores : null);

/**
 * Events of the shown run that somebody wants to see, switches among them where there is truth.
 * @param {Readonly<PageState>} state
 */
export function eventsNow(state) {
	const { timeline, server, eventKind } = state;
	const { done = 0, tracks = [] } = timeline ?? {};
	const all = eventsOf(tracks, { fps: server?.sequence?.fps ?? 25, done, switches: scoresOf(state)?.series.switches });
	return all.filter(({ kind }) => !eventKind || kind === eventKind);
}

/**
 * Whether only the selected track is shown.
 * @param {Readonly<PageState>} state
 */
export const isAlone = ({ selection, layers3d }) => selection !== null && layers3d.others === false;

/**
 * What a camera's method says of the people in its picture: "3 and 5 occluded, 7 new".
 * @param {ViewEvent[]} events
 */
export function viewWords(events) {
	return events.map(({ kind, labels }) => `${labels.join(", ").replace(/, (?!.*,)/, " and ")} ${kind}`).join(", ");
}

/**
 * The nearest event after or before a step.
 * @param {LaneEvent[]} events  by step
 * @param {number} step
 * @param {-1 | 1} direction
 */
export function nextEvent(events, step, direction) {
	if (direction > 0) return events.find((event) => event.step > step);
	return [...events].reverse().find((event) => event.step < step);
}

/**
 * Tracks in the order of the lanes.
 * @param {TrackLane[]} tracks
 * @param {"longest" | "born"} order  longest: people first, ghosts of a few steps last
 */
export function ordered(tracks, order) {
	const length = (/** @type {TrackLane} */ { first, last }) => last - first;
	return [...tracks].sort((a, b) => (order === "longest" ? length(b) - length(a) : a.first - b.first) || a.id - b.id);
}

/**
 * What a track is doing at a step.
 * @param {TrackLane} track
 * @param {number} step
 * @returns {"not yet" | "ended" | "seen" | "coasting" | "lost"} lost: not reported at this step, but later again
 */
export function stateAt({ first, last, spans }, step) {
	if (step < first) return "not yet";
	if (step > last) return "ended";
	const span = spans.find(([from, to]) => step >= from && step <= to);
	return span?.[2] ?? "lost";
}
