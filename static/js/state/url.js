/** A place as text: the address that shows a colleague the same. */

const KNOWN = ["seq", "step", "sel", "cam"];

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
	const camera = whole("cam");
	const values = [...query].filter(([key]) => key.startsWith("p."));
	return {
		place: {
			sequence: query.get("seq") || null,
			step: whole("step"),
			selection: whole("sel"),
			camera: camera === null || camera < 1 ? null : camera - 1,
			values: values.length
				? Object.fromEntries(values.map(([key, text]) => [key.slice(2), text]))
				: null,
		},
		unknown: [...query.keys()].filter((key) => !KNOWN.includes(key) && !key.startsWith("p.")),
	};
}

/**
 * @param {Place} place  the camera is an index; the address counts from 1, as the page does
 * @returns {string} beginning with a question mark, or empty
 */
export function writePlace({ sequence, step, selection, camera, values }) {
	const query = new URLSearchParams();
	if (sequence) query.set("seq", sequence);
	if (step !== null) query.set("step", String(step));
	if (selection !== null) query.set("sel", String(selection));
	if (camera !== null) query.set("cam", String(camera + 1));
	for (const [key, value] of Object.entries(values ?? {})) query.set(`p.${key}`, String(value));
	const text = query.toString();
	return text ? `?${text}` : "";
}
