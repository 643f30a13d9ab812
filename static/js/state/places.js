/**
 * The places of the page, in the order of the work; the hash of the address names one. Who brings
 * another place adds a row here and marks in the markup what belongs to it (`data-place`).
 */

/** @type {{name: string, word: string, tip: string}[]} */
export const PLACES = [
	{ name: "tune", word: "Tune", tip: "3D, pictures and parameters on one clock" },
	{ name: "library", word: "Library", tip: "Recordings and runs that are kept" },
];

/** The place that a hash names; the first one where it names none. @param {string} hash */
export const placeOf = (hash) => (PLACES.find(({ name }) => `#${name}` === hash) ?? PLACES[0]).name;
