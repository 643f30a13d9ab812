/**
 * Elements of the sheet that opens recordings, and how its controls say what they wish.
 *
 * A control with `data-wish` has the changes that it makes of the wish, as JSON; in them `"$"`
 * stands for the control's value and `"#"` for its number times `data-scale`. A control with
 * `data-do` does what the sheet has under that name.
 */
import { h, icon } from "../elements/dom.js";

/** @typedef {Child | Child[]} Inside */
/** @typedef {Record<string, unknown>} Wish */

/** Formats of calibrations, as a person knows them. */
export const CALIBRATIONS =
	"OpenCV, Pose2Sim, Caliscope, Anipose, Qualisys, COLMAP, Metashape, Kalibr, ROS, projections";

/** @param {Inside} words @param {Attributes} [attributes] */
export const small = (words, attributes) => h("span", { class: "small", ...attributes }, words);

/** Text in one line, whole by the pointer. @param {string} words @param {string} [kind] @param {string} [whole] */
export const cut = (words, kind = "", whole = words) =>
	h("span", { class: `${kind} cut`.trim(), title: whole }, words);

export const grow = () => h("span.grow");

/** The head of a part, and what stands beside it. @param {string} words @param {...Inside} beside */
export const heading = (words, ...beside) => h("h3.h", words, ...beside);

/** A button that does something of the sheet's. @param {Inside} words @param {string} act @param {string} [kind] @param {Attributes} [attributes] */
export const button = (words, act, kind = "box", attributes = {}) =>
	h("button", { class: `btn ${kind}`, "data-do": act, ...attributes }, words);

export const close = () => button(icon("i-close"), "close", "icon", { "aria-label": "Close" });

/** A button that changes the wish. @param {Inside} words @param {Wish} wish @param {string} [kind] @param {Attributes} [attributes] */
export const wishing = (words, wish, kind = "box", attributes = {}) =>
	h("button", { class: `btn ${kind}`, "data-wish": JSON.stringify(wish), ...attributes }, words);

/** A field that changes the wish. @param {string} id @param {string} label @param {string} value @param {Wish} wish @param {Attributes} [attributes] */
export const field = (id, label, value, wish, attributes) =>
	h("input", {
		id,
		"aria-label": label,
		value,
		"data-wish": JSON.stringify(wish),
		autocomplete: "off",
		type: "text",
		...attributes,
	});

/** @param {string} id @param {string} label @param {number} value @param {Wish} wish @param {Attributes} [attributes] @param {number} [digits] */
export const numberField = (id, label, value, wish, attributes, digits = 2) =>
	field(id, label, value.toFixed(digits), wish, { type: "number", step: "any", ...attributes });

/**
 * A choice that changes the wish.
 * @param {string} id @param {string} label
 * @param {(readonly [string, string])[]} choices  values and words
 * @param {string} now @param {Wish} wish
 * @param {Record<string, string>} [off]  values that cannot be chosen, each with the reason
 */
export const select = (id, label, choices, now, wish, off = {}) =>
	h(
		"select",
		{ id, "aria-label": label, "data-wish": JSON.stringify(wish) },
		choices.map(([value, words]) =>
			h(
				"option",
				{ value, selected: value === now, disabled: value in off, title: off[value] },
				words,
			),
		),
	);

/** Buttons beside each other, one of them pressed. @param {string} label @param {string[]} choices @param {string} now @param {string} key  of the wish */
export const segment = (label, choices, now, key) =>
	h(
		"div.seg",
		{ role: "group", "aria-label": label },
		choices.map((one) =>
			h(
				"button",
				{ "aria-pressed": String(one === now), "data-wish": JSON.stringify({ [key]: one }) },
				one.replaceAll("-", "−"),
			),
		),
	);
