/**
 * The places of the page, in the order of the work; the hash of the address names one. Another
 * place is another row; its module is read when somebody first goes there.
 */

/** @type {PageSite[]} */
export const PLACES = [
	{
		name: "tune",
		word: "Tune",
		tip: "3D, pictures and parameters on one clock",
		bench: true,
	},
	{
		name: "check",
		word: "Check",
		tip: "Doubtful moments, put right",
		bench: true,
		read: () => import("../check/check.js").then(({ mountCheck }) => mountCheck),
		exists: ({ sequence }) => sequence !== null,
	},
	{
		name: "study",
		word: "Study",
		tip: "Many runs at once: which values are better, and which matter",
		read: () => import("../study/study.js").then(({ mountStudy }) => mountStudy),
		sign: ({ study }) =>
			study?.state === "running"
				? [study.done, study.trials].filter((count) => count !== null).join("/")
				: "",
	},
	{
		name: "library",
		word: "Library",
		tip: "Recordings and runs that are kept",
		read: () => import("../library/library.js").then(({ mountLibrary }) => mountLibrary),
	},
];

/** The place that a hash names; the first one where it names none. @param {string} hash */
export const placeOf = (hash) => (PLACES.find(({ name }) => `#${name}` === hash) ?? PLACES[0]).name;

/** Whether a place is the workbench with its clock. @param {string} place */
export const isBench = (place) => PLACES.some(({ name, bench }) => bench && name === place);
