/** A place as text: the address that shows a colleague the same. */
import { VIEW_KEYS } from "./views.js";

const KNOWN = ["seq", "step", "sel", "cam", "look", ...VIEW_KEYS];

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
	const values = [...query].filter(([key]) => key.startsWith("p."));
	const look = query.get("look") === "top" ? "top" : index("look");
	return {
		place: {
			sequence: query.get("seq") || null,
			step: whole(query.get("step")),
			selection: whole(query.get("sel")),
			camera: index("cam") < 0 ? null : index("cam"),
			look: look === -1 ? null : look,
			values: values.length
				? Object.fromEntries(values.map(([key, text]) => [key.slice(2), text]))
				: null,
			view: Object.fromEntries([...query].filter(([key]) => VIEW_KEYS.includes(key))),
		},
		unknown: [...query.keys()].filter((key) => !KNOWN.includes(key) && !key.startsWith("p.")),
	};
}

/**
 * @param {Place} place
 * @returns {string} beginning with a question mark, or empty
 */
export function writePlace({ sequence, step, selection, camera, look, values, view }) {
	const query = new URLSearchParams();
	if (sequence) query.set("seq", sequence);
	if (step !== null) query.set("step", String(step));
	if (selection !== null) query.set("sel", String(selection));
	if (camera !== null) query.set("cam", String(camera + 1));
	if (look !== null) query.set("look", look === "top" ? look : String(look + 1));
	for (const [key, text] of Object.entries(view)) query.set(key, text);
	for (const [key, value] of Object.entries(values ?? {})) query.set(`p.${key}`, String(value));
	const text = query.toString();
	return text ? `?${text}` : "";
}
