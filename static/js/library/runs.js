/** The table of a recording's runs. */
import { h, icon, rate, remember, remembered } from "../elements/dom.js";
import { symbolOf } from "../elements/drawn.js";
import { menuOf, opensMenu } from "../elements/over.js";
import { table } from "../elements/table.js";
import { figure, isMethod, livesAMinute, madeWhen, many, methodWord } from "./words.js";

/** Figures with a bar: what the bar is from and to, and which end is the better. */
const FIGURES = /** @type {const} */ ([
	["mota", "MOTA", 0.6, 1, 1],
	["idf1", "IDF1", 0.6, 1, 1],
	["hota", "HOTA", 0.6, 1, 1],
	["ospa", "OSPA m", 0.2, 0, -1],
]);

/**
 * A figure that is compared with those of other runs; none while it is provisional.
 * @param {Server.KeptRunInfo} run
 * @param {(typeof FIGURES)[number][0]} key
 */
const final = (run, key) => (run.provisional ? null : run[key]);

/** Tracks that begin in a minute, where nothing can be scored. */
const LIVES = "Tracks/min";

const PILLS = 3;

/** @param {Server.KeptRunInfo} run @param {boolean} taught  whether runs differ in their templates */
function pills(run, taught) {
	const changes = run.changes.filter(({ key }) => !isMethod(key));
	if (!changes.length && !run.corrected && !(taught && run.templates)) return h("span.q", "–");
	const all = changes.map(({ key, value }) => `${key} ${value}`).join("\n");
	const shown = changes
		.slice(0, PILLS)
		.map(({ symbol, value }) => h("span.pc", symbolOf(symbol, "q"), " ", methodWord(value)));
	const more = changes.length - PILLS;
	return h(
		"span",
		{ title: all },
		taught &&
			run.templates &&
			h("span.pc", { title: run.templates.join("\n") }, many(run.templates.length, "template")),
		shown,
		more > 0 && h("span.pc", `+${more}`),
		run.corrected > 0 && h("span.pc", icon("i-pin", "s"), `${run.corrected} corrected`),
	);
}

/** Under which this browser remembers the columns that it does not show. */
const COLUMNS = "library columns";

/**
 * @param {object} on
 * @param {(run: Server.KeptRunInfo) => void} on.focus
 * @param {(run: Server.KeptRunInfo) => void} on.open
 * @param {(run: Server.KeptRunInfo) => void} on.star
 * @param {(run: Server.KeptRunInfo) => void} on.tick
 */
export function runsTable(on) {
	/** @type {Set<number>} */
	let ticked = new Set();
	/** Of the recording, and whether it has a truth. */
	let [fps, scored] = [0, true];
	/** Whether its runs differ in their templates. */
	let taught = false;
	/** @type {Record<string, number | null>} the best of each column */
	const best = {};

	/** @type {Column<Server.KeptRunInfo>[]} */
	const columns = [
		{
			word: "",
			kind: "ck",
			cell: (run) =>
				h("input", {
					type: "checkbox",
					tabindex: -1,
					"aria-label": `Choose run ${run.id}`,
					checked: ticked.has(run.id),
					onclick: (event) => (event.stopPropagation(), on.tick(run)),
				}),
		},
		{
			word: "Run",
			by: (run) => run.id,
			cell: (run) => [
				h(
					"button",
					{
						class: `st${run.star ? " on" : ""}`,
						tabindex: -1,
						"aria-label": "Star",
						"aria-pressed": String(run.star),
						onclick: (event) => (event.stopPropagation(), on.star(run)),
					},
					icon("i-star", run.star ? "s full" : "s"),
				),
				h("b", run.name || String(run.id)),
				run.name ? h("span.q", ` ${run.id}`) : null,
				run.older_code
					? h("span.q", { title: "Another version of the program made it" }, " older code")
					: null,
				run.provisional
					? h(
							"span.q",
							{
								title:
									"Its figures were made before it was finished; opening it computes them again",
							},
							" provisional figures",
						)
					: null,
			],
		},
		{
			word: "When",
			kind: "q",
			by: (run) => run.latest,
			cell: (run) => madeWhen(run),
		},
		{
			word: "Methods",
			by: true,
			cell: (run) => [
				methodWord(run.single_view),
				h("span.q", " › "),
				methodWord(run.fusion_method),
			],
		},
		{
			word: "Differs from default",
			kind: "chs",
			by: (run) => run.changes.length,
			cell: (run) => pills(run, taught),
		},
		...FIGURES.map(([key, word, from, to]) => ({
			word,
			kind: "num met",
			by: (/** @type {Server.KeptRunInfo} */ run) => final(run, key) ?? -Infinity,
			cell: (/** @type {Server.KeptRunInfo} */ run) => {
				if (run.provisional) return h("span.q", `(${figure(run[key])})`);
				const value = run[key];
				const share = value === null ? 0 : (value - from) / (to - from);
				return [
					h("span", { class: value !== null && value === best[key] ? "top1" : "" }, figure(value)),
					h("i.mb", { "--v": Math.max(0.02, Math.min(1, share)) }),
				];
			},
		})),
		{
			word: LIVES,
			kind: "num",
			by: (run) => livesAMinute(run, fps) ?? Infinity,
			cell: (run) => figure(livesAMinute(run, fps), 1),
		},
		{ word: "Tracks", kind: "num", by: (run) => run.targets, cell: (run) => run.targets },
		{
			word: "Steps/s",
			kind: "num",
			by: (run) => run.steps_per_second,
			cell: (run) => (run.steps_per_second ? rate(run.steps_per_second) : "–"),
		},
		{ word: "Note", kind: "q note-cell cut", by: true, cell: (run) => run.note },
	];
	const rows = table("Runs", columns, {
		key: (run) => run.id,
		by: "When",
		down: true,
		// Arrows go on from the row that was clicked.
		choose: (run, { currentTarget }) => {
			/** @type {HTMLElement} */ (currentTarget).focus();
			on.focus(run);
		},
		open: on.open,
		attributes: (run) => ({ "data-run": run.id }),
	});

	/** Words of the columns that somebody does not want. @type {Set<string>} */
	const hidden = new Set(remembered(COLUMNS, []));
	const hide = () => {
		for (const row of rows.element.querySelectorAll("tr"))
			[...row.cells].forEach((cell, k) => {
				const word = columns[k]?.word;
				// Figures need a truth; what they are replaced by needs none.
				const wrong = scored ? word === LIVES : FIGURES.some(([, one]) => one === word);
				cell.hidden = wrong || hidden.has(word);
			});
	};
	const menu = menuOf(
		{ class: "menu plots", "aria-label": "Columns" },
		columns
			.filter(({ word }) => word && word !== "Run")
			.map(({ word }) =>
				h(
					"label",
					h("input", {
						type: "checkbox",
						checked: !hidden.has(word),
						onchange: () => {
							if (!hidden.delete(word)) hidden.add(word);
							remember(COLUMNS, [...hidden]);
							hide();
						},
					}),
					h("b", word),
				),
			),
	);
	const chooser = h("button.btn", { "aria-haspopup": "true" }, "Columns", icon("i-down", "s"));
	opensMenu(chooser, menu);

	return {
		element: h("div.scroll", rows.element),
		/** What chooses the columns. */
		chooser: [chooser, menu],
		/**
		 * @param {Server.KeptRunInfo[]} runs
		 * @param {Set<number>} chosen
		 * @param {number | null} focused
		 * @param {Server.RecordingInfo | null} recording  whose runs they are
		 */
		show(runs, chosen, focused, recording) {
			ticked = chosen;
			[fps, scored] = [recording?.fps ?? 0, recording?.people !== null];
			taught = new Set(runs.flatMap(({ templates }) => templates?.join() ?? [])).size > 1;
			for (const [key, , , , sign] of FIGURES) {
				const values = runs.map((run) => final(run, key)).filter((value) => value !== null);
				best[key] = values.length > 1 ? sign * Math.max(...values.map((v) => sign * v)) : null;
			}
			rows.show(runs);
			rows.each((run, row) => {
				row.ariaSelected = String(run.id === focused);
				row.classList.toggle("picked-row", chosen.has(run.id));
				if (run.id === focused) row.tabIndex = 0;
				else if (focused !== null) row.tabIndex = -1;
			});
			hide();
		},
	};
}
