/** Colours for the canvases, read from the tokens once a theme. */
import { colourIndex } from "../elements/dom.js";

/** @param {Element} element  whose theme counts @returns {Palette} */
function read(element) {
	const style = getComputedStyle(element);
	/** @type {Map<string, string>} */
	const known = new Map();
	const get = (/** @type {string} */ name) => {
		let value = known.get(name);
		if (value === undefined) known.set(name, (value = style.getPropertyValue(`--${name}`).trim()));
		return value;
	};
	return {
		get,
		id: (id) => get(`id-${colourIndex(id)}`),
		on: (id) => get(`on-${colourIndex(id)}`),
		font: get("font"),
	};
}

/** @type {{theme: string, palette: Palette} | null} */
let current = null;
/** @type {Palette | null} */
let dark = null;

/** Colours of the chosen theme. */
export function palette() {
	const theme = document.documentElement.dataset.theme ?? "dark";
	if (current?.theme !== theme) current = { theme, palette: read(document.documentElement) };
	return current.palette;
}

/** Colours on pictures, which have no theme. */
export function pictureInk() {
	if (!dark) {
		const probe = document.createElement("i");
		probe.dataset.theme = "dark";
		probe.hidden = true;
		document.body.append(probe);
		dark = read(probe);
	}
	return dark;
}

/** @param {string} hex  #rrggbb @param {number} alpha  0 … 1 */
export function faded(hex, alpha) {
	return (
		hex +
		Math.round(alpha * 255)
			.toString(16)
			.padStart(2, "0")
	);
}
