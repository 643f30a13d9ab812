/** The trials of a study, and what is done with the chosen one: used, compared, kept, repeated. */
import { fill, h, icon, symbolOf } from "../elements/dom.js";
import { getJson } from "../state/api.js";
import { differenceOf, figureOf, titledOf, valueOf } from "./words.js";

/* ---------- The table of trials, best first: what the figures show, in numbers. ---------- */

/** Rows that are shown; the export has all. */
const MOST_ROWS = 200;

/**
 * @param {object} on
 * @param {(number: number) => void} on.choose
 * @param {(number: number) => void} on.use
 */
function trialsTable({ choose, use }) {
	const element = h("div", { class: "scroll", tabindex: 0, "aria-label": "Trials, best first" });
	/** @type {number[]} in the order of the table */
	let order = [];

	/**
	 * @param {Server.Study} study
	 * @param {Server.TrialInfo[]} trials
	 * @param {number | null} chosen
	 */
	function show(study, trials, chosen) {
		const [lead] = study.objectives;
		const standard = trials.find(({ number }) => number === 0);
		const worth = (/** @type {Server.TrialInfo} */ trial) =>
			trial.number === study.best
				? Infinity
				: trial.objectives === null || trial.vetoed || trial.state !== "complete"
					? -Infinity
					: (lead.higher ? 1 : -1) * trial.objectives[0];
		const rows = trials
			.filter(({ number }) => number !== 0)
			.sort((a, b) => worth(b) - worth(a) || a.number - b.number)
			.slice(0, MOST_ROWS);
		if (standard) rows.push(standard);
		order = rows.map(({ number }) => number);
		const head = h(
			"tr",
			{},
			h("th", {}, "Trial"),
			study.objectives.map((of, k) =>
				h(
					"th",
					{
						class: "num",
						title: of.help,
						"aria-sort": k ? null : lead.higher ? "descending" : "ascending",
					},
					titledOf(of),
				),
			),
			study.beside.map((of) => h("th", { class: "num", title: of.help }, titledOf(of))),
			study.varied.map((range) =>
				h("th", { class: "num", title: `${range.label}: ${range.help}` }, symbolOf(range.symbol)),
			),
			h("th", { class: "num" }, "Time s"),
			h("th", {}, h("span", { class: "vh" }, "Use")),
		);
		fill(
			element,
			h(
				"table",
				{ class: "bt" },
				h("caption", { class: "vh" }, "Trials, best first; the default last"),
				h("thead", {}, head),
				h(
					"tbody",
					{},
					rows.map((trial) => row(study, trial, standard, chosen)),
				),
			),
		);
	}

	/**
	 * @param {Server.Study} study
	 * @param {Server.TrialInfo} trial
	 * @param {Server.TrialInfo | undefined} standard
	 * @param {number | null} chosen
	 */
	function row(study, trial, standard, chosen) {
		const { number } = trial;
		const sign =
			number === 0
				? ""
				: number === study.best
					? "best"
					: trial.vetoed
						? "vetoed"
						: trial.state !== "complete"
							? trial.state
							: study.objectives.length > 1 && study.front.includes(number)
								? "front"
								: "";
		return h(
			"tr",
			{
				"aria-selected": String(number === chosen),
				"data-trial": number,
				title: trial.words || null,
				onclick: () => choose(number),
			},
			h(
				"td",
				{},
				h(
					"button",
					{ class: "as-text", onclick: () => choose(number) },
					number ? number : "default",
				),
				sign && h("span", { class: "q" }, ` ${sign}`),
			),
			study.objectives.map((of, k) =>
				h(
					"td",
					{ class: "num" },
					figureOf(trial.objectives?.[k], of),
					number !== 0 && differenceOf(trial.objectives?.[k], standard?.objectives?.[k], of),
				),
			),
			study.beside.map((of) =>
				h(
					"td",
					{ class: "num" },
					figureOf(trial.figures[of.key], of),
					number !== 0 && differenceOf(trial.figures[of.key], standard?.figures[of.key], of),
				),
			),
			study.varied.map(({ key }) =>
				h("td", { class: "num pv2" }, key in trial.values ? valueOf(trial.values[key]) : "·"),
			),
			h("td", { class: "num" }, trial.seconds.toFixed(1)),
			h(
				"td",
				{ class: "act" },
				number === 0
					? h("span", { class: "q" }, "trial 0")
					: h(
							"button",
							{
								class: "btn",
								"aria-label": `Use trial ${number}`,
								onclick: (event) => (event.stopPropagation(), use(number)),
							},
							"Use",
						),
			),
		);
	}

	/** The trial before or after one in the table. @param {number | null} from @param {number} by */
	function beside(from, by) {
		const at = order.indexOf(from ?? Number.NaN);
		return order[Math.min(order.length - 1, Math.max(0, at < 0 ? 0 : at + by))] ?? null;
	}

	/** @param {number | null} number */
	function reveal(number) {
		element.querySelector(`tr[data-trial="${number}"]`)?.scrollIntoView({ block: "nearest" });
	}

	return { element, show, beside, reveal };
}

/**
 * @param {Pick<Context, "store" | "actions">} context
 * @param {{choose: (number: number) => void, chosen: () => number | null, name: () => string, path: (rest?: string) => string}} study
 */
export function bestTrials({ store, actions }, { choose, chosen, name, path }) {
	const rows = trialsTable({ choose, use: (number) => void use(number) });
	const which = h("span", { class: "sub" });
	const put = h("button", { class: "btn main", onclick: () => useChosen() }, "Use");
	const beside = h(
		"button",
		{ class: "btn box", onclick: () => void compare() },
		"Compare with current",
	);
	const keep = h("button", { class: "btn box", onclick: askName }, "Save as preset…");
	const differs = h("span", { class: "sub" });
	const command = h(
		"button",
		{
			class: "btn",
			onclick: () => void copyCommand(),
			title: "The command that gives these tracks again",
		},
		icon("i-copy", "s"),
		"Command",
	);
	const element = h(
		"section",
		{ class: "pane tab2", "aria-label": "Best trials" },
		h(
			"div",
			{ class: "pane-head" },
			h("h2", { class: "pane-title" }, "Best trials"),
			differs,
			h("span", { class: "grow" }),
			which,
			put,
			beside,
			keep,
			command,
		),
		rows.element,
	);
	/** @param {number} number */
	async function use(number) {
		if (!(await actions.command("use_trial", { study: name(), trial: number }))) return;
		actions.note(
			"info",
			`The values of ${number ? `trial ${number}` : "the default"} are on the sliders`,
			"Ctrl Z takes them back.",
			{
				word: "To Tune",
				act: () => (location.hash = "#tune"),
			},
		);
	}

	async function compare() {
		const number = chosen();
		if (number === null || !(await actions.ask("POST", "run/pin"))) return;
		if (await actions.command("use_trial", { study: name(), trial: number }))
			location.hash = "#tune";
		store.set({ tab: "compare" });
	}

	/** The name is asked for where the button stands. */
	function askName() {
		const number = chosen();
		const field = h("input", {
			class: "field",
			value: `${name()} ${number}`,
			"aria-label": "Name of the preset",
		});
		let over = false;
		const end = async (/** @type {boolean} */ kept) => {
			if (over) return;
			over = true;
			field.replaceWith(keep);
			if (!kept || !field.value.trim()) return;
			if (
				await actions.command("keep_trial", {
					study: name(),
					trial: number,
					preset: field.value.trim(),
				})
			)
				actions.note(
					"info",
					`Kept as the preset ${field.value.trim()}`,
					"It is among the presets in Tune.",
				);
		};
		field.addEventListener("keydown", (event) => {
			event.stopPropagation();
			if (event.key === "Enter" || event.key === "Escape") void end(event.key === "Enter");
		});
		field.addEventListener("blur", () => void end(false));
		keep.replaceWith(field);
		field.select();
	}

	async function copyCommand() {
		const number = chosen();
		if (number === null) return;
		const { commands } = await getJson(`/api/${path(`/trials/${number}`)}`);
		await navigator.clipboard.writeText(commands.join("\n"));
		actions.note("info", "The command was copied", commands[0] ?? "");
	}

	function useChosen() {
		const number = chosen();
		if (number !== null) void use(number);
	}

	return {
		element,
		rows,
		compare,
		use: useChosen,
		/** @param {Server.Study} study @param {Server.TrialInfo[]} done in the order in which they ended */
		show(study, done) {
			const number = chosen();
			rows.show(study, done, number);
			fill(
				differs,
				`difference to the default${study.definition.seeds?.length > 1 ? `, mean of ${study.definition.seeds.length} seeds` : ""}`,
			);
			fill(which, number === null ? "" : number ? `trial ${number}` : "default");
			for (const part of [put, beside, keep, command]) part.disabled = number === null;
		},
	};
}
