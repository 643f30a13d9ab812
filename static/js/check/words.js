/** What Check says and proposes of its places, without touching the page. */

/** Signs of doubts and of corrections. @type {Record<string, string>} */
export const ICONS = {
	exchange: "i-exchange",
	crossing: "i-exchange",
	exchanged: "i-exchange",
	join: "i-join",
	same: "i-join",
	cut: "i-split",
	different: "i-split",
	gap: "i-split",
	fast: "i-split",
	short: "i-trash",
	nobody: "i-trash",
	ends: "i-end",
	left: "i-end",
	begins: "i-start",
	came: "i-start",
	missing: "i-here",
	here: "i-here",
	name: "i-name",
	checked: "i-tick",
};

/** "step 92" or "steps 92 – 98". @param {number} first @param {number} last */
export const stepsOf = (first, last) =>
	first === last ? `step ${first}` : `steps ${first} – ${last}`;

/** A number and its unit stand on one line. @param {string} text */
export const unbroken = (text) => text.replace(/(\d) (?=(?:m|s|px|%)(?!\w))/g, "$1\u00a0");

/**
 * The alternatives with words of their own, each with its place among all: of those that differ in
 * the step alone the likeliest, or the one that is shown.
 * @param {Doubt} doubt @param {number} shown
 * @returns {[Doubt["alternatives"][number], number][]}
 */
export const distinct = ({ alternatives }, shown) =>
	alternatives
		.map((one, k) => /** @type {[typeof one, number]} */ ([one, k]))
		.filter(([one, k]) => {
			const same = alternatives.flatMap(({ words }, at) => (words === one.words ? [at] : []));
			return k === (same.includes(shown) ? shown : same[0]);
		});

/** How sure, as whole percent. @param {number} share  0 … 1 */
export const percent = (share) => `${Math.round(100 * share)} %`;

/** The time of day of a correction, or its day where that is not today's. @param {string} time */
export function clockOf(time, now = new Date()) {
	const at = new Date(time);
	const two = (/** @type {number} */ n) => String(n).padStart(2, "0");
	return at.toDateString() === now.toDateString()
		? `${two(at.getHours())}:${two(at.getMinutes())}`
		: `${at.getFullYear()}-${two(at.getMonth() + 1)}-${two(at.getDate())}`;
}

/** The alternative that is likelier than all others; 0 is as it is. @param {Doubt} doubt */
export const proposed = ({ alternatives }) =>
	alternatives.reduce(
		(best, { probability }, k) => (probability > alternatives[best].probability ? k : best),
		0,
	);

/** The likeliest that is not as it is; 0 where there is none. @param {Doubt} doubt */
export const otherOf = ({ alternatives }) =>
	alternatives.reduce(
		(best, { probability, as_it_is: same }, k) =>
			!same && (best === 0 || probability > alternatives[best].probability) ? k : best,
		0,
	);

/** Whether two people may have been exchanged there. @param {Doubt} doubt */
export const isOfTwo = ({ kind, tracks }) =>
	tracks.length > 1 && (kind === "exchange" || kind === "crossing");

/**
 * Eight steps that tell a place: before, in between and after, in order and each once.
 * @param {number} first @param {number} last
 * @param {{frames: number, fps: number}} recording
 */
export function filmSteps(first, last, { frames, fps }) {
	const pause = Math.max(1, Math.round(fps / 2));
	const [from, to] = [Math.min(first, last), Math.max(first, last)];
	const wanted = [
		...[0, 1 / 3, 2 / 3, 1].map((share) => Math.round(from + share * (to - from))),
		from - pause,
		to + pause,
		from - 2 * pause,
		to + 2 * pause,
	];
	for (let k = 3; k < 40; k += 1) wanted.push(from - k * pause, to + k * pause);
	for (let k = 1; k < 9; k += 1) wanted.push(from - k, to + k);
	const inside = wanted.filter((step) => step >= 0 && step < frames);
	return [...new Set(inside)].slice(0, 8).sort((a, b) => a - b);
}

/**
 * The cameras, those first that see most of the people at most of the steps, and see them largest.
 * @param {(Server.Step | null)[]} results  of the steps
 * @param {number[]} ids
 * @param {number} cameras  how many there are
 */
export function camerasFor(results, ids, cameras) {
	const worth = Array.from({ length: cameras }, (_, camera) => {
		let [seen, size] = [0, 0];
		for (const result of results) {
			for (const { id, box, visible } of result?.cameras[camera]?.tracks ?? []) {
				if (!ids.includes(id) || !box || !visible) continue;
				seen += 1;
				size += box[3];
			}
		}
		return { camera, seen, size };
	});
	return worth
		.sort((a, b) => b.seen - a.seen || b.size - a.size || a.camera - b.camera)
		.map(({ camera }) => camera);
}

/**
 * Whose box shows at a step where somebody would be after a change: the nearest track.
 * @param {Server.AlternativePreview | null} preview
 * @param {number} id  as it would be
 * @param {Server.Step | null} result
 * @returns {number | null} the id as it is; null where there is nobody
 */
export function standsFor(preview, id, result) {
	const track = preview?.tracks.find((one) => one.id === id);
	if (!track || !result) return id;
	const at = track.positions[result.step - track.first];
	if (!at) return null;
	/** @type {{id: number | null, far: number}} */
	let best = { id: null, far: 0.5 };
	for (const { id: now, position } of result.tracks) {
		const far = Math.hypot(...position.map((value, axis) => value - at[axis]));
		if (far < best.far) best = { id: now, far };
	}
	return best.id;
}

/**
 * Others alive at a step or near it, the nearest first.
 * @param {number} id
 * @param {Server.Step | null} result
 * @param {Server.TrackLife[]} tracks
 * @param {number} step
 */
function neighbours(id, result, tracks, step) {
	const own = result?.tracks.find((track) => track.id === id)?.position;
	const placeOf = (/** @type {number} */ other) =>
		result?.tracks.find((track) => track.id === other)?.position;
	const away = (/** @type {Server.TrackLife} */ { first, last }) =>
		Math.max(0, first - step, step - last);
	return tracks
		.filter((track) => track.id !== id)
		.map((track) => {
			const at = placeOf(track.id);
			const metres = own && at ? Math.hypot(own[0] - at[0], own[1] - at[1]) : null;
			return { id: track.id, metres, steps: away(track), first: track.first, last: track.last };
		})
		.sort((a, b) => a.steps - b.steps || (a.metres ?? 1e9) - (b.metres ?? 1e9) || a.id - b.id);
}

/**
 * Whom a track may be exchanged with from a step on: who is there before the step and from it on, as
 * it is itself, the nearest first; where that is nobody, why.
 * @param {number} id
 * @param {Server.Step | null} result
 * @param {Server.TrackLife[]} tracks
 * @param {number} step
 */
export function exchangeable(id, result, tracks, step) {
	const both = (/** @type {{first: number, last: number}} */ { first, last }) =>
		first < step && step <= last;
	const own = tracks.find((track) => track.id === id);
	if (!own || !both(own))
		return {
			found: [],
			why:
				!own || step < own.first || step > own.last
					? `Track ${id} is not there at step ${step}` +
						(own ? `: it is from step ${own.first} to ${own.last}.` : ".")
					: `Track ${id} begins at step ${step}: there is nothing before it to exchange.`,
		};
	const found = neighbours(id, result, tracks, step).filter(both);
	return {
		found,
		why: found.length ? "" : `Nobody else is there both before step ${step} and from it on.`,
	};
}

/**
 * Whom a track may be joined with: who begins after its end or ends before its beginning, the least
 * pause first; then who is there at the same time, as of :func:`neighbours`.
 * @param {number} id
 * @param {Server.Step | null} result
 * @param {Server.TrackLife[]} tracks
 * @param {number} step
 */
export function joinable(id, result, tracks, step) {
	const own = tracks.find((track) => track.id === id);
	return neighbours(id, result, tracks, step)
		.map((other) => ({
			...other,
			/** Steps from the end of the one to the beginning of the other; 0 for both at once. */
			pause: own ? Math.max(0, other.first - own.last, own.first - other.last) : 0,
		}))
		.sort((a, b) => Number(!a.pause) - Number(!b.pause) || a.pause - b.pause);
}

/**
 * When or how far from somebody another is, in a few words.
 * @param {{metres: number | null, steps: number, first: number, last: number, pause?: number}} other
 * @param {number} step  that is shown
 * @param {Server.TrackLife} [own]
 */
export function whereIs({ metres, steps, first, last, pause }, step, own) {
	const count = (/** @type {number} */ many) => `${many} ${many === 1 ? "step" : "steps"}`;
	if (pause && own)
		return first > own.last
			? `begins ${count(pause)} after its end`
			: `ends ${count(pause)} before its beginning`;
	if (metres !== null) return `${metres.toFixed(1)} m away`;
	return steps
		? `${count(steps)} ${first > step ? "later" : "before"}`
		: `steps ${first} – ${last}`;
}

/**
 * The next place where two people come close, after a step; round again at the end.
 * @param {Doubt[]} doubts @param {number} step
 */
export function nextCrossing(doubts, step) {
	const meetings = doubts.filter(isOfTwo).sort((a, b) => middleOf(a) - middleOf(b));
	return meetings.find((doubt) => middleOf(doubt) > step) ?? meetings[0] ?? null;
}

/** The step at which a place is looked at. @param {Doubt} doubt */
export const middleOf = ({ first, last }) => Math.round((first + last) / 2);

/**
 * Whether two places are one moment of the same people, in a run and in the next one: by the shift
 * of a place somebody is known by another id.
 * @param {Doubt} one @param {Doubt | null} other
 */
export const isLike = (one, other) =>
	other !== null &&
	one.kind === other.kind &&
	one.tracks.length === other.tracks.length &&
	one.tracks.every((track) => other.tracks.includes(track)) &&
	one.first <= other.last &&
	other.first <= one.last;
