/** A place as text: the address that shows a colleague the same. */
import { VIEW_KEYS } from "./views.js";

const KNOWN = ["seq", "step", "sel", "cam", "look", "a", ...VIEW_KEYS];

/**
 * @param {string} search  with or without the question mark
 * @returns {{place: Place, unknown: string[]}} keys that mean nothing here are named, not fatal
 */
export function readPlace(search) {
	const query = new URLSearchParams(search);
	const whole = (/** @type {string | null} */ text) =>
		text !== null && /^\d{1,9}$/.test(text) ? Number(text) : null;
	/** A camera's index; the address counts from 1, as the page does. */
	const index = (/** @type {string} */ key) => (whole(query.get(key)) || 0) - 1;
	/** Values by key; what differs from the defaults. @param {string} head */
	const valuesOf = (head) => {
		const found = [...query].filter(([key]) => key.startsWith(head));
		return found.length
			? Object.fromEntries(found.map(([key, text]) => [key.slice(head.length), text]))
			: null;
	};
	const look = query.get("look") === "top" ? "top" : index("look");
	return {
		place: {
			sequence: query.get("seq") || null,
			step: whole(query.get("step")),
			selection: whole(query.get("sel")),
			camera: index("cam") < 0 ? null : index("cam"),
			look: look === -1 ? null : look,
			values: valuesOf("p."),
			// Run A may stand at its defaults: then it is named alone.
			pinned: valuesOf("a.") ?? (query.has("a") ? {} : null),
			view: Object.fromEntries([...query].filter(([key]) => VIEW_KEYS.includes(key))),
		},
		unknown: [...query.keys()].filter((key) => !KNOWN.includes(key) && !/^[pa]\./.test(key)),
	};
}

/**
 * @param {Place} place
 * @returns {string} beginning with a question mark, or empty
 */
export function writePlace({ sequence, step, selection, camera, look, values, pinned, view }) {
	const query = new URLSearchParams();
	if (sequence) query.set("seq", sequence);
	if (step !== null) query.set("step", String(step));
	if (selection !== null) query.set("sel", String(selection));
	if (camera !== null) query.set("cam", String(camera + 1));
	if (look !== null) query.set("look", look === "top" ? look : String(look + 1));
	for (const [key, text] of Object.entries(view)) query.set(key, text);
	for (const [key, value] of Object.entries(values ?? {})) query.set(`p.${key}`, String(value));
	if (pinned && !Object.keys(pinned).length) query.set("a", "defaults");
	for (const [key, value] of Object.entries(pinned ?? {})) query.set(`a.${key}`, String(value));
	const text = query.toString();
	return text ? `?${text}` : "";
}
