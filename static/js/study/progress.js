/** How far a study is, and what each worker does. */
import { fill, h, icon } from "../elements/dom.js";
import { lasting, nameOf } from "./words.js";

/** @param {{pause: () => void}} on */
export function progressPane({ pause }) {
	const element = h("section", { class: "pane prog", "aria-label": "Progress" });

	/** @param {Server.Study} now @param {string} going what is just being done with it, if anything */
	function show({ info, status, definition, sentences }, going) {
		const running = info.state === "running";
		const { done, trials } = info;
		// where the time alone ends it, its share
		const timed =
			info.state === "done" ? 1 : Math.min(1, status.seconds / (60 * (definition.minutes ?? 1)));
		const part = trials === null ? timed : done / Math.max(1, trials);
		/** @type {Record<string, string>} */
		const words = { running: "Pause", done: "Done", new: "Start" };
		const word = going || (words[info.state] ?? "Go on");
		const gone = [
			`${status.runs} runs`,
			lasting(status.seconds),
			status.seconds_left !== null && running ? `${lasting(status.seconds_left)} left` : "",
			status.busy === null ? "" : `workers ${Math.round(100 * status.busy)} % busy`,
		];
		fill(
			element,
			h(
				"div",
				{ class: "pgl" },
				h(
					"div",
					{ class: "big" },
					h("b", {}, done),
					h("span", { class: "q" }, trials === null ? " trials so far" : ` of ${trials} trials`),
				),
				h(
					"span",
					{
						class: "bar wide",
						"--part": part,
						role: "progressbar",
						"aria-label": "Trials",
						"aria-valuenow": trials === null ? Math.round(100 * part) : done,
						"aria-valuemin": 0,
						"aria-valuemax": trials ?? 100,
					},
					h("i"),
				),
				h("div", { class: "q" }, gone.filter(Boolean).join(" · ")),
			),
			h(
				"div",
				{ class: "wk" },
				running && status.workers.length
					? status.workers.slice(0, 4).map((worker, k) => workerRow(worker, k))
					: h("div", { class: "q" }, info.words || sentences[0] || ""),
				status.workers.length > 4 &&
					h("div", { class: "q" }, `and ${status.workers.length - 4} more workers`),
			),
			h(
				"button",
				{
					class: "btn box tall2",
					"data-key": "Space",
					onclick: pause,
					disabled: Boolean(going) || info.state === "done",
				},
				icon(running ? "i-pause" : "i-play", "s"),
				word,
			),
		);
	}

	return { element, show };
}

/** @param {Server.WorkerInfo} worker @param {number} k */
function workerRow({ words, trial, recording, seed, machine }, k) {
	return h(
		"div",
		{ class: "wrow" },
		h("span", { title: machine }, `worker ${k + 1}`),
		h("span", {}, words || (trial === null ? "waits" : trial ? `trial ${trial}` : "the default")),
		h("span", { class: "q" }, recording && !words ? `${nameOf(recording)}, seed ${seed}` : ""),
	);
}
