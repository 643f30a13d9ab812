/** Which tracks are listed: all, false ones, those with misses, those with the largest errors. */

/** Share of the tracks that count as the worst. */
const WORST = 0.2;

/**
 * The tracks of each kind; without truth nothing is false and no error known.
 * @param {Server.TrackLife[]} tracks
 * @param {Map<number, Server.ScoredTrackInfo>} scored  by id
 * @param {[number, number, string][]} events
 * @returns {Record<PageState["listed"], Server.TrackLife[]>}
 */
export function kindsOf(tracks, scored, events) {
	const missed = new Set(events.flatMap(([, id, kind]) => (kind === "long miss" ? [id] : [])));
	const error = (/** @type {Server.TrackLife} */ { id }) => scored.get(id)?.mean_error ?? -1;
	const known = tracks.filter((track) => error(track) >= 0).sort((a, b) => error(b) - error(a));
	return {
		all: tracks,
		false: tracks.filter(({ id }) => scored.get(id)?.kind === "false"),
		missed: tracks.filter(({ id }) => missed.has(id)),
		worst: known.slice(0, Math.ceil(WORST * known.length)),
	};
}

/** What each kind is called, and what it means. @type {[PageState["listed"], string, string][]} */
export const KINDS = [
	["all", "all", "All tracks"],
	["false", "false", "Tracks that are nobody's by the truth"],
	["missed", "with misses", "Tracks that no camera saw for 1.5 s or longer"],
	["worst", "worst error", "The fifth of the tracks with the largest mean errors"],
];
