/** How a study words things. Touches no page. */
import { many } from "../library/words.js";
import { h, show } from "../elements/dom.js";

/** How long something takes. @param {number | null} seconds */
export function lasting(seconds) {
	if (seconds === null) return "";
	const whole = Math.round(seconds);
	if (whole < 60) return `${whole} s`;
	const minutes = Math.floor(whole / 60);
	if (minutes < 60) return `${minutes} min ${whole % 60} s`;
	return `${Math.floor(minutes / 60)} h ${minutes % 60} min`;
}

/** A recording by the last part of its path. @param {string} place */
export const nameOf = (place) => place.split(/[\\/]/).filter(Boolean).at(-1) ?? place;

/** A value of a parameter, as short as it stays readable. @param {any} value */
export const valueOf = (value) =>
	typeof value === "number"
		? show(Number(value.toPrecision(3)))
		: typeof value === "boolean"
			? value
				? "on"
				: "off"
			: String(value ?? "default");

/** A figure. @param {number | null | undefined} value @param {Server.ObjectiveInfo} of */
export const figureOf = (value, { digits }) =>
	value === null || value === undefined ? "–" : value.toFixed(digits);

/**
 * The difference to the default, and whether it is for the better.
 * @param {number | null | undefined} value
 * @param {number | null | undefined} from
 * @param {Server.ObjectiveInfo} of
 */
export function differenceOf(value, from, { digits, higher }) {
	if (value === null || value === undefined || from === null || from === undefined) return null;
	const text = Math.abs(value - from).toFixed(digits);
	if (!Number(text)) return h("span.dl", text);
	const more = value > from;
	return h(
		"span",
		{ class: `dl ${more === higher ? "better" : "worse"}` },
		`${more ? "+" : "−"}${text}`,
	);
}

/** What a figure is called with its unit. @param {Server.ObjectiveInfo} of */
export const titledOf = ({ name, unit }) => (unit ? `${name} ${unit}` : name);

/** @type {Record<Server.StudyInfo["state"], string>} */
const STATES = {
	new: "not started",
	running: "running",
	stopped: "paused",
	done: "done",
	failed: "failed",
};

/** A study in a line. @param {Server.StudyInfo} study */
export function lineOf({ name, state, done, trials }) {
	return `${name}  ·  ${state === "new" ? STATES.new : `${trials === null ? many(done, "trial") : `${done} of ${many(trials, "trial")}`}, ${STATES[state]}`}`;
}
