/** The trials of a study, and what is done with the chosen one: used, compared, kept, repeated. */
import { fill, h, icon } from "../elements/dom.js";
import { getJson } from "../state/api.js";
import { trialsTable } from "./trials.js";

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
		if (!(await actions.ask("POST", path(`/trials/${number}/use`)))) return;
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
		if (await actions.ask("POST", path(`/trials/${number}/use`))) location.hash = "#tune";
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
			if (await actions.ask("POST", path(`/trials/${number}/preset`), { name: field.value.trim() }))
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
