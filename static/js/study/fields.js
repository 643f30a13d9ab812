/** Small pieces of what is written down of a study. */
import { h, icon } from "../elements/dom.js";

/** @type {[string, string][]} */
export const SEARCHES = [
	["auto", "narrowing"],
	["tpe", "narrowing, one figure"],
	["nsga2", "evolution"],
	["random", "at random"],
	["grid", "grid"],
];

/**
 * @param {() => void} changed
 * @param {string} label
 * @param {number | null} value
 * @param {(value: number | null) => void} set
 * @param {object} [more]
 */
export function numberField(changed, label, value, set, more = {}) {
	const field = h("input", {
		type: "number",
		step: "any",
		class: "field",
		value: value ?? "",
		"aria-label": label,
		...more,
		oninput: () => {
			set(field.value === "" ? null : Number(field.value));
			changed();
		},
	});
	return field;
}

/** @param {string} word @param {false | (() => void)} out @param {string} [title] */
export const tag = (word, out, title) =>
	h(
		"span",
		{ class: "pc", title: title ?? word },
		word,
		out &&
			h(
				"button",
				{ class: "btn icon", "aria-label": `Leave out ${word}`, onclick: out },
				icon("i-close", "s"),
			),
	);

/**
 * Parameters and their ranges, a row each.
 * @param {Child} count
 * @param {Child[]} rows
 * @param {string} [last]  what a further column is for
 */
export const rangesBlock = (count, rows, last) => [
	h(
		"h3",
		{ class: "h" },
		"Parameters",
		h("span", { class: "grow" }),
		h("span", { class: "small" }, count),
	),
	h(
		"table",
		{ class: "pt" },
		h(
			"thead",
			{},
			h(
				"tr",
				{},
				h("th", {}, "name"),
				h("th", { class: "num" }, "from"),
				h("th", { class: "num" }, "to"),
				h("th", {}, "scale"),
				last && h("th", {}, h("span", { class: "vh" }, last)),
			),
		),
		h("tbody", {}, rows),
	),
];

/**
 * One of several cards, of which one is chosen.
 * @param {boolean} on  whether it is this one
 * @param {string} title
 * @param {() => void} choose
 * @param {boolean} can  whether it may be chosen
 * @param {...Child} rest  what stands below its title
 */
export const choiceCard = (on, title, choose, can, ...rest) =>
	h(
		"div",
		{ class: `choice${on ? " on" : ""}` },
		h(
			"button",
			{
				class: "as-text",
				role: "radio",
				"aria-checked": String(on),
				disabled: !can,
				onclick: choose,
			},
			h("b", {}, title),
		),
		rest,
	);
