/** The trials of a study, and what is done with the chosen one: used, compared, kept, repeated. */
import { all, fill, h, icon } from "../elements/dom.js";
import { asks, grow, paneHead, symbolOf } from "../elements/drawn.js";
import { table } from "../elements/table.js";
import { getJson } from "../state/api.js";
import { differenceOf, figureOf, titledOf, valueOf } from "./words.js";

/* ---------- The table of trials, best first: what the figures show, in numbers. ---------- */

/** Rows that are shown; the export has all. */
const MOST_ROWS = 200;

/** What a trial is called beside its number. @param {Server.Study} study @param {Server.TrialInfo} trial */
function signOf({ best, front, objectives }, { number, vetoed, state }) {
	if (number === 0) return "";
	if (number === best) return "best";
	if (vetoed) return "vetoed";
	if (state !== "complete") return state;
	return objectives.length > 1 && front.includes(number) ? "front" : "";
}

/**
 * @param {object} on
 * @param {(number: number) => void} on.choose
 * @param {(number: number) => void} on.use
 */
function trialsTable({ choose, use }) {
	const element = h("div.scroll", { tabindex: 0, "aria-label": "Trials, best first" });
	/** @type {Server.Study} */
	let study;
	/** @type {Server.TrialInfo | undefined} */
	let standard;
	/** @type {Table<Server.TrialInfo> | null} */
	let rows = null;
	/** The study and the columns that it is made of. */
	let made = "";

	/**
	 * A figure of the trials, and its difference to the default.
	 * @param {Server.ObjectiveInfo} of
	 * @param {(trial: Server.TrialInfo) => number | undefined} at
	 * @returns {Column<Server.TrialInfo>}
	 */
	const figure = (of, at) => ({
		word: titledOf(of),
		help: of.help,
		kind: "num",
		by: (trial) => at(trial) ?? Number.NaN,
		cell: (trial) => [
			figureOf(at(trial), of),
			trial.number !== 0 && differenceOf(at(trial), standard && at(standard), of),
		],
	});

	/** @returns {Column<Server.TrialInfo>[]} */
	const columns = () => [
		{
			word: "Trial",
			by: ({ number }) => number,
			cell: (trial) => {
				const { number } = trial;
				const sign = signOf(study, trial);
				return [
					h("button.as-text", { onclick: () => choose(number) }, number ? number : "default"),
					sign && h("span.q", ` ${sign}`),
				];
			},
		},
		...study.objectives.map((of, k) => figure(of, ({ objectives }) => objectives?.[k])),
		...study.beside.map((of) => figure(of, ({ figures }) => figures[of.key])),
		...study.varied.map(({ key, label, symbol, help }) => {
			/** @type {Column<Server.TrialInfo>} */
			const column = {
				word: key,
				head: symbolOf(symbol),
				help: `${label}: ${help}`,
				kind: "num pv2",
				by: true,
				cell: ({ values }) => (key in values ? valueOf(values[key]) : "·"),
			};
			return column;
		}),
		{
			word: "Time s",
			kind: "num",
			by: ({ seconds }) => seconds,
			cell: ({ seconds }) => seconds.toFixed(1),
		},
		{
			word: "",
			kind: "act",
			cell: ({ number }) =>
				number === 0
					? h("span.q", "trial 0")
					: h(
							"button.btn",
							{
								"aria-label": `Use trial ${number}`,
								onclick: (event) => (event.stopPropagation(), use(number)),
							},
							"Use",
						),
		},
	];

	/**
	 * @param {Server.Study} now
	 * @param {Server.TrialInfo[]} trials
	 * @param {number | null} chosen
	 */
	function show(now, trials, chosen) {
		study = now;
		const { info, objectives, beside, varied } = now;
		const needed = [info.name, ...[objectives, beside, varied].flat().map(({ key }) => key)].join();
		if (needed !== made || !rows) {
			made = needed;
			rows = table(`Trials of ${info.name}, best first`, columns(), {
				key: ({ number }) => number,
				attributes: ({ number, words }) => ({
					"data-trial": number,
					title: words || null,
					onclick: () => choose(number),
				}),
			});
			rows.element.className = "bt";
			fill(element, rows.element);
		}
		const [lead] = objectives;
		standard = trials.find(({ number }) => number === 0);
		const worth = (/** @type {Server.TrialInfo} */ trial) =>
			trial.number === study.best
				? Infinity
				: trial.objectives === null || trial.vetoed || trial.state !== "complete"
					? -Infinity
					: (lead.higher ? 1 : -1) * trial.objectives[0];
		const listed = trials
			.filter(({ number }) => number !== 0)
			.sort((a, b) => worth(b) - worth(a) || a.number - b.number)
			.slice(0, MOST_ROWS);
		rows.show(standard ? [...listed, standard] : listed);
		rows.each(({ number }, row) => (row.ariaSelected = String(number === chosen)));
	}

	const lines = () => all("tr[data-trial]", element);
	const lineOf = (/** @type {number | null} */ number) =>
		lines().findIndex(({ dataset }) => Number(dataset.trial) === number);

	/** The trial before or after one in the table. @param {number | null} from @param {number} by */
	function beside(from, by) {
		const [at, last] = [lineOf(from), lines().length - 1];
		const next = lines()[Math.min(last, Math.max(0, at < 0 ? 0 : at + by))];
		return next ? Number(next.dataset.trial) : null;
	}

	/** @param {number | null} number */
	const reveal = (number) => lines()[lineOf(number)]?.scrollIntoView({ block: "nearest" });

	return { element, show, beside, reveal };
}

/**
 * @param {Pick<Context, "store" | "actions">} context
 * @param {{choose: (number: number) => void, chosen: () => number | null, name: () => string, path: (rest?: string) => string}} study
 */
export function bestTrials({ store, actions }, { choose, chosen, name, path }) {
	const rows = trialsTable({ choose, use: (number) => void use(number) });
	const which = h("span.sub");
	const put = h("button.btn.main", { onclick: () => useChosen() }, "Use");
	const beside = h("button.btn.box", { onclick: () => void compare() }, "Compare with current");
	const keep = h("button.btn.box", { onclick: askName }, "Save as preset…");
	const differs = h("span.sub");
	const command = h(
		"button.btn",
		{ onclick: () => void copyCommand(), title: "The command that gives these tracks again" },
		icon("i-copy", "s"),
		"Command",
	);
	const element = h(
		"section.pane.tab2",
		{ "aria-label": "Best trials" },
		paneHead("Best trials", differs, grow(), which, put, beside, keep, command),
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
		const trial = chosen();
		const asked = { value: `${name()} ${trial}`, "aria-label": "Name of the preset" };
		const field = asks(asked, async (text) => {
			field.replaceWith(keep);
			const preset = text?.trim();
			if (preset && (await actions.command("keep_trial", { study: name(), trial, preset })))
				actions.note("info", `Kept as the preset ${preset}`, "It is among the presets in Tune.");
		});
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
