/** One run in small, and what can be done with it: opened, pinned, taken as the start of a study. */
import { fill, h } from "../elements/dom.js";
import { grow } from "../elements/drawn.js";
import { getJson } from "../state/api.js";
import { drawn } from "./small.js";
import { many, titleOf, when } from "./words.js";

/**
 * @param {Pick<Context, "store" | "actions">} context
 * @param {(run: Server.KeptRunInfo, note: string) => void} written  somebody wrote a note
 */
export function preview({ store, actions }, written) {
	const head = h("div.pane-head");
	const body = h("div.pv-body");
	const element = h("section.pane.pv", { "aria-label": "The run" }, head, body);
	/** @type {Server.KeptRunInfo | null} */
	let now = null;
	/** @type {number | null} what the body shows */
	let shown = null;
	body.addEventListener("change", ({ target }) => {
		if (now) written(now, /** @type {HTMLInputElement} */ (target).value);
	});

	/** What is said of a stored run holds as long as it is shown. */
	let kept = store.get().run?.kept;
	store.on(["run"], ({ run }) => {
		if (run?.kept !== kept) actions.accepted(`run ${kept}`);
		kept = run?.kept;
	});

	/** Show it in the workbench as it was. @param {Server.KeptRunInfo} run */
	async function open(run) {
		const state = await actions.openRun(run.id, run.recording_name);
		if (!state) return;
		location.hash = "#tune";
		const older = state.run.stands_for;
		actions.note(
			older ? "warn" : "info",
			`${titleOf(run)} is shown as it was`,
			older
				? "Another version of the program, or another state of the recording, made it."
				: "Its tracks were kept; what the cameras found comes back by computing again.",
			{ word: "Compute again", act: actions.runAgain },
			`run ${run.id}`,
		);
	}

	/** @param {Server.KeptRunInfo} run */
	async function pin(run) {
		if (await actions.ask("POST", `library/runs/${run.id}/pin`))
			actions.note("info", `${titleOf(run)} is run A now`, "Tune sets the shown run against it.");
	}

	/** A study varies what is on the sliders, so the run's values come there. */
	/** @param {Server.KeptRunInfo} run */
	async function study(run) {
		if (!(await actions.openRun(run.id, run.recording_name))) return;
		store.set({ wantsStudy: true });
		location.hash = "#study";
	}

	/** @param {Server.KeptRunInfo} run */
	function facts(run) {
		const told = [when(run.began), many(run.targets, "track")];
		if (run.seconds) told.push(`computed in ${run.seconds.toFixed(run.seconds < 9.5 ? 1 : 0)} s`);
		return told.join(" · ");
	}

	return {
		element,
		open,
		/** @param {Server.KeptRunInfo | null} run */
		async show(run) {
			now = run;
			if (!run) {
				shown = null;
				fill(head);
				const empty = "A run that is chosen is shown here in small.";
				return fill(body, h("p.blank", empty));
			}
			fill(
				head,
				h("h2.pane-title", titleOf(run)),
				h("span.sub", facts(run)),
				grow(),
				h("button.btn.main", { onclick: () => void open(run) }, "Open in Tune"),
				h("button.btn.box", { onclick: () => void pin(run) }, "Pin as A"),
				h(
					"button.btn.box",
					{
						title: "A new study of this recording, around the values of this run",
						onclick: () => void study(run),
					},
					"Start a study here",
				),
			);
			const answer = await getJson(`/api/library/runs/${run.id}`).catch((error) => error);
			if (run.id !== now?.id) return;
			// Whoever writes a note is not disturbed.
			if (run.id === shown && body.contains(document.activeElement)) return;
			shown = answer instanceof Error ? null : run.id;
			if (answer instanceof Error) fill(body, h("p.blank", answer.message));
			else fill(body, ...drawn(answer));
		},
	};
}
