// @ts-check
/** Everything that the drawn views show of one step, as tables. */
import { bucketOf } from "../clock.js";
import { fill, fixed, h, idTag, parts, show, write } from "../dom.js";
import { scoresOf } from "../events.js";
import { grid } from "../grid.js";

const vector = (/** @type {number[]} */ values) => values.map((value) => fixed(value, 2)).join("  ");

const MEASURES = /** @type {const} */ ([
	["ospa", "OSPA"],
	["ospa_localisation", "OSPA, location"],
	["ospa_cardinality", "OSPA, number"],
	["gospa", "GOSPA"],
	["gospa_localisation", "GOSPA, location"],
	["gospa_missed", "GOSPA, missed"],
	["gospa_false", "GOSPA, false"],
]);

/** @type {Pane} */
export function mountStep(root, { store }) {
	const { stack, words, blank } = parts(root);
	const errorOf = (/** @type {number} */ id) => store.get().result?.truth.find(({ track }) => track === id)?.error;
	/** @type {Column<StepResult["tracks"][0]>[]} */
	const columns = [
		{ word: "In 3D", cell: ({ id }) => idTag(id) },
		{ word: "Weight", kind: "num", cell: ({ existence }) => existence.toFixed(3) },
		{ word: "x, y, z  m", kind: "num", cell: ({ position }) => vector(position) },
		{ word: "± m", kind: "num", cell: ({ sigma }) => vector(sigma) },
		{ word: "Error  m", kind: "num", cell: ({ id }) => fixed(errorOf(id), 3) },
	];
	const people = grid("People in 3D", columns, { key: ({ id }) => id });
	/** @typedef {TrackInView & {camera: string}} Row */
	/** @type {Column<Row>[]} */
	const views = [
		{ word: "Camera", cell: ({ camera }) => camera },
		{ word: "Track", cell: ({ id }) => idTag(id) },
		{ word: "State", cell: ({ seen }) => (seen ? "seen" : "coasting") },
		{ word: "p_D", kind: "num", cell: ({ detection_probability: p }) => show(p === null ? null : Number(p.toFixed(3))) },
		{ word: "Because", cell: ({ hidden_by: front, reason }) => (front !== null ? `hidden by ${front}` : reason ?? "") },
		{ word: "Fed by", cell: ({ fed_by: fed, source }) => (fed ? `box ${source + 1}, ${fed.weight.toFixed(2)}, ${Math.round(100 * fed.share)} %` : "–") },
		{ word: "Left, top, width, height  px", kind: "num opt-1", cell: ({ box }) => (box ? box.map(Math.round).join("  ") : "–") },
	];
	const pictures = grid("Tracks in the pictures", views, { key: ({ camera, id }) => `${camera} ${id}` });
	/** @type {Column<[string, ...(number | string)[]]>[]} */
	const curves = [
		{ word: "Measure", cell: ([name]) => name },
		{ word: "B", kind: "num", cell: (row) => row[1] },
		{ word: "A", kind: "num q", cell: (row) => row[2] ?? "–" },
	];
	const numbers = grid("Curves at this step", curves, { key: ([name]) => name });
	stack.append(people.element, pictures.element, numbers.element);

	function render() {
		const state = store.get();
		const { result, basis, shown, tab, server } = state;
		if (tab !== "step") return;
		const current = result?.run === basis && result.computed ? result : null;
		blank.hidden = current !== null;
		if (!current) return fill(blank, h("h3", {}, "Nothing is computed at this step"), h("p", {}, "Where people are, what each camera saw of them and the curves' values are listed here."));
		people.show(current.tracks);
		pictures.show(current.cameras.flatMap(({ name, tracks }) => tracks.map((track) => ({ ...track, camera: name }))));
		const scores = scoresOf(state);
		/** @type {[string, ...(number | string)[]][]} */
		const rows = [["People, reported", current.tracks.length], ["People, expected", current.cardinality.toFixed(2)], ["Components", current.components]];
		if (server?.sequence?.has_truth) rows.push(["People, true", current.truth.length]);
		for (const [name, word] of scores ? MEASURES : []) {
			const [b, a] = [scores?.series, scores?.reference].map((series) => fixed(series?.[name][bucketOf(shown, series)], 3));
			rows.push([`${word}  m`, b, a]);
		}
		for (const { name, information } of current.cameras) for (const [word, value] of Object.entries(information)) rows.push([`${name}: ${word}`, show(Number(value.toPrecision(4)))]);
		numbers.show(rows);
		write(words, `step ${shown} of ${server?.sequence?.frames ?? 0}`);
	}
	store.on(["result", "scores", "tab", "basis"], render);
	render();
}
