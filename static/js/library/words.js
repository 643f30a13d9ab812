/** How the library words things. Touches no page. */

const DAY = 86_400_000;

/**
 * When something was, as short as it is clear.
 * @param {number} seconds  since 1970
 * @param {Date} [now]
 */
export function when(seconds, now = new Date()) {
	const date = new Date(seconds * 1000);
	const midnight = new Date(now.getFullYear(), now.getMonth(), now.getDate());
	const days = Math.ceil((midnight.getTime() - date.getTime()) / DAY);
	if (days <= 0) return date.toLocaleTimeString("en-GB", { hour: "2-digit", minute: "2-digit" });
	if (days === 1) return "yesterday";
	if (days < 7) return date.toLocaleDateString("en-GB", { weekday: "long" });
	return date.toLocaleDateString("en-GB", { day: "numeric", month: "short", year: "numeric" });
}

/**
 * When a run was made, and when again, where that reads differently.
 * @param {{began: number, latest: number}} run  @param {Date} [now]
 */
export function madeWhen({ began, latest }, now = new Date()) {
	const [first, last] = [when(began, now), when(latest, now)];
	return first === last ? first : `${first}, again ${last}`;
}

/** @param {number} count @param {string} word */
export const many = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;

/** @param {number} bytes */
export const size = (bytes) =>
	bytes < 1e6
		? `${Math.ceil(bytes / 1e3)} kB`
		: bytes < 1e9
			? `${(bytes / 1e6).toFixed(1)} MB`
			: `${(bytes / 1e9).toFixed(1)} GB`;

/** @param {number | null} value @param {number} [digits] */
export const figure = (value, digits = 3) => (value === null ? "–" : value.toFixed(digits));

/**
 * How many tracks begin in a minute of the recording: where there is no truth, a run that needs
 * fewer for the same people breaks them up less.
 * @param {Pick<Server.KeptRunInfo, "targets" | "steps">} run
 * @param {number} fps  0 where it is not known
 */
export const livesAMinute = ({ targets, steps }, fps) =>
	fps && steps ? (60 * targets * fps) / steps : null;

/** Templates that are named of a run. */
const MOST_TEMPLATES = 3;

/**
 * The colour templates of each run: how many, and which of them not all runs have.
 * @param {Pick<Server.KeptRunInfo, "templates">[]} runs
 * @returns {string[]}
 */
export const templateWords = (runs) =>
	runs.map(({ templates }) => {
		if (!templates) return "not known";
		const others = runs.map((run) => run.templates ?? templates);
		const own = templates.filter((one) => others.some((other) => !other.includes(one)));
		const more = own.length > MOST_TEMPLATES ? [`and ${own.length - MOST_TEMPLATES} more`] : [];
		return [String(templates.length), ...own.slice(0, MOST_TEMPLATES), ...more].join("; ");
	});

/** The methods that every run has, and what their stage is called. */
export const METHODS = /** @type {const} */ ([
	["single_view", "Single view"],
	["fusion_method", "Fusion"],
]);

/** Whether a change is told with the methods. @param {string} key */
export const isMethod = (key) => METHODS.some(([method]) => method === key);

/** A method, or a choice, in words. @param {string} key */
export const methodWord = (key) => key.replaceAll("_", " ");

/** @param {Server.KeptRunInfo} run */
export const titleOf = (run) => run.name || `Run ${run.id}`;

/**
 * The shortest end of a path that none of the others has; null where each end has another.
 * @param {string} path @param {string[]} others
 */
export function ownEnd(path, others) {
	const foldersOf = (/** @type {string} */ place) => place.split(/[\\/]/).filter(Boolean);
	const end = (/** @type {string} */ place, /** @type {number} */ count) =>
		foldersOf(place).slice(-count).join("/");
	for (let count = 1; count < foldersOf(path).length; count += 1)
		if (others.every((other) => end(other, count) !== end(path, count))) return end(path, count);
	return null;
}

/**
 * Where recordings lie that have a name in common: the end of each one's path that no other has, by
 * its path. Those with a name of their own are left out.
 * @param {Pick<Server.RecordingInfo, "name" | "place">[]} recordings
 * @returns {Map<string, string>}
 */
export function whereabouts(recordings) {
	/** @type {Map<string, string>} */
	const found = new Map();
	for (const { name, place } of recordings) {
		const others = recordings.filter((other) => other.name === name && other.place !== place);
		if (!others.length) continue;
		const end = ownEnd(
			place,
			others.map((other) => other.place),
		);
		found.set(place, end === null ? place : `…/${end}`);
	}
	return found;
}

/** What a recording is. @param {Server.RecordingInfo} recording */
export function factsOf({ cameras, frames, fps, boxes_only: boxes, people, missing }) {
	if (missing) return missing;
	const seconds = fps ? Math.round(frames / fps) : 0;
	const long =
		seconds >= 60
			? `${Math.floor(seconds / 60)} min${seconds % 60 ? ` ${seconds % 60} s` : ""}`
			: `${seconds} s`;
	return [
		many(cameras, "camera"),
		boxes ? "boxes only" : seconds ? long : frames ? many(frames, "step") : "",
		people === null ? "" : "truth",
	]
		.filter(Boolean)
		.join(" · ");
}

/** Whether all words of a text are in some of the texts. @param {string} text @param {string[]} of */
export function has(text, of) {
	const all = of.join(" ").toLowerCase();
	return text
		.toLowerCase()
		.split(/\s+/)
		.every((word) => all.includes(word));
}
