// @ts-check
/**
 * The address holds what a colleague needs to see the same: sequence, step, selection, camera.
 */

/**
 * @param {string} search  with or without the question mark
 * @returns {{place: Place, unknown: string[]}} keys that mean nothing here are named, not fatal
 */
export function readPlace(search) {
	const query = new URLSearchParams(search);
	const whole = (/** @type {string} */ key) => {
		const text = query.get(key);
		return text !== null && /^\d{1,9}$/.test(text) ? Number(text) : null;
	};
	const known = ["seq", "step", "sel", "cam"];
	const camera = whole("cam");
	return {
		place: {
			sequence: query.get("seq") || null,
			step: whole("step"),
			selection: whole("sel"),
			camera: camera === null || camera < 1 ? null : camera - 1,
		},
		unknown: [...query.keys()].filter((key) => !known.includes(key)),
	};
}

/**
 * @param {Place} place  the camera is an index; the address counts from 1, as the page does
 * @returns {string} beginning with a question mark, or empty
 */
export function writePlace({ sequence, step, selection, camera }) {
	const query = new URLSearchParams();
	if (sequence) query.set("seq", sequence);
	if (step !== null) query.set("step", String(step));
	if (selection !== null) query.set("sel", String(selection));
	if (camera !== null) query.set("cam", String(camera + 1));
	const text = query.toString();
	return text ? `?${text}` : "";
}
