/** How far each parameter is varied. */
import { choices, h, icon, symbolOf } from "../elements/dom.js";
import { numberField, rangesBlock } from "./fields.js";
import { valueOf } from "./words.js";

/** @import { Wish } from "./form.js" */
/** @typedef {{low: number | null, high: number | null, log: boolean, choices: any[] | null}} Range */
/** @typedef {{changed: () => void, show: () => void, add: (key: string) => Promise<void>}} On */

/** @param {Server.RangeInfo} range @returns {Range} */
export const rangeOf = ({ low, high, log, choices: all }) => ({
	low,
	high,
	log,
	choices: all.length ? [...all] : null,
});

/**
 * The parameters that are varied, each with its range.
 * @param {Wish} now
 * @param {Server.RangeInfo[]} known  those that were ever chosen
 * @param {Server.ParameterInfo[]} all
 * @param {On} on
 */
export function parameterRanges(now, known, all, on) {
	const rest = all.filter(({ key }) => !(key in now.parameters));
	const more = h("select", {
		class: "field",
		"aria-label": "Vary another parameter",
		onchange: () => void on.add(more.value),
	});
	choices(
		more,
		[
			["", "vary another…"],
			...rest.map(
				({ key, label, group }) => /** @type {[string, string]} */ ([key, `${label} · ${group}`]),
			),
		],
		"",
	);
	return h(
		"div",
		{ class: "blk" },
		rangesBlock(
			`${Object.keys(now.parameters).length} of ${all.length}`,
			Object.entries(now.parameters).map(([key, range]) => parameter(now, known, key, range, on)),
			"leave out",
		),
		more,
	);
}

/**
 * @param {Wish} now
 * @param {Server.RangeInfo[]} known
 * @param {string} key
 * @param {Range} range
 * @param {On} on
 */
function parameter(now, known, key, range, { changed, show }) {
	const found = known.find((one) => one.key === key);
	const label = found?.label ?? key;
	const out = h(
		"button",
		{
			class: "btn icon",
			"aria-label": `Leave out ${label}`,
			onclick: () => {
				delete now.parameters[key];
				show();
				changed();
			},
		},
		icon("i-close", "s"),
	);
	const name = h(
		"td",
		{ title: found?.help ?? "" },
		h("span", { class: "lab" }, label),
		" ",
		found && symbolOf(found.symbol),
	);
	if (range.choices)
		return h(
			"tr",
			{},
			name,
			h(
				"td",
				{ colspan: 3, class: "num" },
				(found?.choices ?? range.choices).map((one) =>
					h(
						"button",
						{
							class: "btn one",
							"aria-pressed": String(range.choices?.includes(one)),
							onclick: () => {
								const left = range.choices?.includes(one)
									? range.choices.filter((other) => other !== one)
									: [...(range.choices ?? []), one];
								range.choices = left;
								show();
								changed();
							},
						},
						valueOf(one),
					),
				),
			),
			h("td", {}, out),
		);
	const ends = { min: found?.minimum, max: found?.maximum };
	return h(
		"tr",
		{},
		name,
		h(
			"td",
			{ class: "num" },
			numberField(changed, `${label} from`, tidy(range.low), (value) => (range.low = value), ends),
		),
		h(
			"td",
			{ class: "num" },
			numberField(changed, `${label} to`, tidy(range.high), (value) => (range.high = value), ends),
		),
		h(
			"td",
			{},
			h(
				"button",
				{
					class: "btn scale",
					"aria-label": `Scale of ${label}: ${range.log ? "logarithmic" : "linear"}`,
					onclick: () => {
						range.log = !range.log;
						show();
						changed();
					},
				},
				range.log ? "log" : "linear",
			),
		),
		h("td", {}, out),
	);
}

/** @param {number | null} value */
const tidy = (value) => (value === null ? null : Number(value.toPrecision(3)));
