/** What a study tries: written down before it starts, locked afterwards. */
import { choices, fill, h, icon } from "../elements/dom.js";
import { getJson, sendJson } from "../state/api.js";
import { SEARCHES, numberField, tag } from "./fields.js";
import { lockedParts } from "./locked.js";
import { objectiveCards } from "./objective.js";
import { parameterRanges, rangeOf } from "./ranges.js";
import { placeOf, runsOn } from "./where.js";
import { nameOf, valueOf } from "./words.js";

/** @import { Range } from "./ranges.js" */
/**
 * @typedef {object} Wish  what is sent, and what of it is only shown
 * @property {string} name
 * @property {string[]} recordings
 * @property {Record<string, Range>} parameters
 * @property {number} trials
 * @property {number} seeds
 * @property {number | null} minutes
 * @property {string} search
 * @property {string[]} objectives
 */
/** @import { Where } from "./where.js" */

const ASKED_MS = 300;

/**
 * @param {Pick<Context, "store" | "actions">} context
 * @param {object} on
 * @param {(wish: Wish, where: Where) => void} on.start
 * @param {(cost: Server.StudyCost | null) => void} on.cost
 * @param {() => void} on.copy
 */
export function definition({ store }, { start, cost: told, copy }) {
	const body = h("div", { class: "scroll" });
	const sub = h("span", { class: "sub" });
	const again = h("button", { class: "btn", onclick: copy }, "Edit a copy");
	const begin = h("button", { class: "btn main tall2", onclick: () => wish && start(wish, where) });
	fill(begin, icon("i-play", "s"), "Start");
	const why = h("p", { class: "small why", role: "status" });
	const foot = h("div", { class: "def-foot" }, why, begin);
	const element = h(
		"section",
		{ class: "pane def", "aria-label": "Definition" },
		h(
			"div",
			{ class: "pane-head" },
			h("h2", { class: "pane-title" }, "What is tried"),
			sub,
			h("span", { class: "grow" }),
			again,
		),
		body,
		foot,
	);

	/** @type {Wish | null} */
	let wish = null;
	/** @type {Server.RangeInfo[]} */
	let known = [];
	/** @type {Server.ObjectiveInfo[]} */
	let figures = [];
	let hasTruth = false;
	/** @type {Where} */
	let where = { scheduler: null, workers: 1 };
	/** @type {Timer} */
	let waiting;
	let asked = 0;

	/** What it would take, asked once somebody pauses. */
	function changed() {
		clearTimeout(waiting);
		waiting = setTimeout(async () => {
			if (!wish) return;
			const turn = (asked += 1);
			const wanted = { ...wish, ...placeOf(where) };
			const answer = await sendJson("POST", "/api/studies/estimate", wanted).catch((error) => ({
				error: error.message,
			}));
			if (turn !== asked || !wish) return;
			begin.disabled = Boolean(answer.error);
			fill(why, answer.error ?? answer.words ?? "");
			why.classList.toggle("bad", Boolean(answer.error));
			told(answer.error ? null : answer);
		}, ASKED_MS);
	}

	/** @param {Server.StudyDraft} draft @param {Partial<Wish>} [from] a study that it is a copy of */
	function edit(draft, from = {}) {
		known = draft.parameters;
		figures = draft.choices;
		hasTruth = draft.has_truth;
		where = { scheduler: null, workers: draft.workers };
		wish = {
			name: draft.name,
			recordings: draft.recordings,
			parameters: Object.fromEntries(known.map((range) => [range.key, rangeOf(range)])),
			trials: 60,
			seeds: 1,
			minutes: null,
			search: "auto",
			objectives: draft.objectives,
			...from,
		};
		show();
		changed();
	}

	/** Another parameter is varied. @param {string} key */
	async function add(key) {
		if (!wish) return;
		const draft = /** @type {Server.StudyDraft} */ (
			await getJson(`/api/studies/draft?keys=${encodeURIComponent(key)}`)
		);
		const found = draft.parameters.find((range) => range.key === key);
		if (!found) return;
		known = [...known.filter((range) => range.key !== key), found];
		wish.parameters[key] = rangeOf(found);
		show();
		changed();
	}

	function show() {
		if (!wish) return;
		element.classList.remove("locked");
		fill(sub, "");
		again.hidden = true;
		foot.hidden = false;
		const now = wish;
		fill(
			body,
			named(now),
			recordings(now),
			parameterRanges(now, known, store.get().schema?.parameters ?? [], { changed, show, add }),
			numbers(now),
			objectiveCards(
				now,
				figures,
				{ hasTruth, cameras: store.get().sequence?.cameras.length ?? 2 },
				{ changed, show },
			),
			runsOn(where, { changed, show }),
		);
	}

	/** @param {Wish} now */
	function named(now) {
		const field = h("input", {
			class: "field",
			value: now.name,
			"aria-label": "Name of the study",
			maxlength: 60,
			oninput: () => {
				now.name = field.value;
				changed();
			},
		});
		return h("div", { class: "blk" }, h("h3", { class: "h" }, "Name"), field);
	}

	/** @param {Wish} now */
	function recordings(now) {
		const others = store
			.get()
			.sequences.filter(
				({ name, error }) =>
					!error && !now.recordings.some((place) => place === name || nameOf(place) === name),
			);
		const more = h("select", {
			class: "field",
			"aria-label": "Add a recording",
			onchange: () => {
				now.recordings = [...now.recordings, more.value];
				show();
				changed();
			},
		});
		choices(more, [["", "add a recording…"], ...others.map(({ name }) => pair(name))], "");
		return h(
			"div",
			{ class: "blk" },
			h("h3", { class: "h" }, "Recordings"),
			h(
				"div",
				{ class: "tags" },
				now.recordings.map((place) =>
					tag(
						nameOf(place),
						now.recordings.length > 1 &&
							(() => {
								now.recordings = now.recordings.filter((one) => one !== place);
								show();
								changed();
							}),
					),
				),
			),
			others.length > 0 && more,
		);
	}

	/** @param {Wish} now */
	function numbers(now) {
		const search = h("select", {
			class: "field",
			"aria-label": "Search",
			onchange: () => {
				now.search = search.value;
				changed();
			},
		});
		choices(search, SEARCHES, now.search);
		/** @param {string} word @param {Element} field */
		const labelled = (word, field) => h("label", {}, h("span", {}, word), field);
		return h(
			"div",
			{ class: "blk four" },
			labelled(
				"Trials",
				numberField(changed, "Trials", now.trials, (value) => (now.trials = value ?? 0), {
					min: 1,
				}),
			),
			labelled(
				"Seeds",
				numberField(changed, "Seeds", now.seeds, (value) => (now.seeds = value ?? 0), { min: 1 }),
			),
			labelled(
				"Minutes",
				numberField(
					changed,
					"At most so many minutes",
					now.minutes,
					(value) => (now.minutes = value),
					{
						placeholder: "any",
					},
				),
			),
			labelled("Search", search),
		);
	}

	/** A study that is there: what it tries cannot change. @param {Server.Study} study */
	function locked(study) {
		wish = null;
		asked += 1;
		element.classList.add("locked");
		foot.hidden = true;
		again.hidden = false;
		state(study.info);
		fill(body, lockedParts(study));
	}

	/** @param {Server.StudyInfo} info */
	const state = (info) => fill(sub, info.state === "running" ? "locked" : "");

	return { element, edit, locked, state, places: () => where };
}

/** @param {string} name @returns {[string, string]} */
const pair = (name) => [name, name];
