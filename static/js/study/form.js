/** What a study tries: written down before it starts, locked afterwards. */
import { fill, h, icon } from "../elements/dom.js";
import { chooser, grow, paneHead, signButton, symbolOf } from "../elements/drawn.js";
import { getJson, sendJson } from "../state/api.js";
import { placeOf, runsOn } from "./where.js";
import { nameOf, valueOf } from "./words.js";

/* ---------- Small pieces of what is written down of a study. ---------- */

const SEARCHES = [
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
const tag = (word, out, title) =>
	h(
		"span.pc.cut",
		{ title: title ?? word },
		word,
		out && signButton("i-close", `Leave out ${word}`, out),
	);

/** @param {string} title @param {...(Child | Child[])} rest */
const block = (title, ...rest) => h("div.blk", h("h3.h", title), ...rest);

/**
 * Parameters and their ranges, a row each.
 * @param {Child} count
 * @param {Child[]} rows
 * @param {string} [last]  what a further column is for
 */
const rangesBlock = (count, rows, last) => [
	h("h3.h", "Parameters", grow(), h("span.small", count)),
	h(
		"table.pt",
		h(
			"thead",
			h(
				"tr",
				h("th", "name"),
				h("th.num", "from"),
				h("th.num", "to"),
				h("th", "scale"),
				last && h("th", h("span.vh", last)),
			),
		),
		h("tbody", rows),
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
			"button.as-text",
			{ role: "radio", "aria-checked": String(on), disabled: !can, onclick: choose },
			h("b", title),
		),
		rest,
	);

/* ---------- What a study that is there tries: it cannot change. ---------- */

/** @param {Server.Study} study */
function lockedParts(study) {
	const { definition: told } = study;
	/** @param {string} word @param {Child} value */
	const line = (word, value) => h("div.pairline", h("span", word), h("span", value));
	const seeds = Array.isArray(told.seeds) ? told.seeds.length : told.seeds;
	return [
		h(
			"div.blk",
			h("h3.h", "Recordings"),
			h(
				"div.tags",
				told.recordings.map((/** @type {string} */ place) => tag(nameOf(place), false, place)),
			),
		),
		h(
			"div.blk",
			rangesBlock(
				study.varied.length,
				study.varied.map(({ label, symbol, help, low, high, log, choices: all }) =>
					h(
						"tr",
						h("td", { title: help }, h("span.lab", label), " ", symbolOf(symbol)),
						all.length
							? h("td.num", { colspan: 3 }, all.map(valueOf).join(", "))
							: [
									h("td.num", valueOf(low)),
									h("td.num", valueOf(high)),
									h("td", log ? "log" : "linear"),
								],
					),
				),
			),
		),
		h(
			"div.blk",
			h("h3.h", "Search"),
			line("trials", study.info.trials ?? "as many as fit"),
			line("seeds", seeds),
			line("search", SEARCHES.find(([key]) => key === told.search)?.[1] ?? told.search),
			told.minutes && line("at most", `${told.minutes} min`),
			line(
				"best is",
				study.objectives.map(({ name, higher }) => `${name} ${higher ? "↑" : "↓"}`).join(", "),
			),
		),
	];
}

/* ---------- What trials are judged by: figures against the truth, or agreement where nobody
   knows it. */

/**
 * @param {Wish} now
 * @param {Server.ObjectiveInfo[]} figures  all that there are
 * @param {{hasTruth: boolean, cameras: number}} of  the recording that is open
 * @param {() => void} edited
 */
function objectiveCards(now, figures, { hasTruth, cameras }, edited) {
	const leads = {
		truth: figures.filter(({ of }) => of !== "agreement"),
		agreement: figures.filter(({ of }) => of === "agreement"),
	};
	const byAgreement = leads.agreement.some(({ key }) => key === now.objectives[0]);
	/** @param {string[]} next */
	const set = (next) => {
		now.objectives = [...new Set(next.filter(Boolean))];
		edited();
	};

	/** @param {number} place @param {string} word @param {Server.ObjectiveInfo[]} from */
	const objective = (place, word, from) => {
		const free = from.filter(
			({ key }) => now.objectives[place] === key || !now.objectives.includes(key),
		);
		const words = free.map(({ key, name, higher }) => [
			key,
			`${name}, ${higher ? "more" : "less"} is better`,
		]);
		const select = chooser(
			word,
			place ? [["", "nothing else"], ...words] : words,
			now.objectives[place] ?? "",
			(key) => set(now.objectives.toSpliced(place, 1, key)),
		);
		return h("label", h("span", word), select);
	};

	/** @param {"truth" | "agreement"} kind @param {string} title @param {string} beside @param {...Child} rest */
	const card = (kind, title, beside, ...rest) => {
		const on = byAgreement === (kind === "agreement");
		const can = leads[kind].length > 0 && (kind === "agreement" || hasTruth);
		return choiceCard(
			on,
			title,
			() => !on && set([usual(kind)]),
			on || can,
			h("span.small.beside", beside),
			...rest,
		);
	};
	/** @param {"truth" | "agreement"} kind */
	const usual = (kind) =>
		(leads[kind].find(({ key }) => kind === "agreement" || key === "idf1") ?? leads[kind][0]).key;
	const others = figures.filter(({ of }) => hasTruth || of !== "truth");
	const lead = figures.find(({ key }) => key === now.objectives[0]);
	const [known] = leads.agreement;

	return block(
		"Objective",
		h(
			"div.stack",
			{ role: "radiogroup", "aria-label": "Objective" },
			card(
				"truth",
				"Truth",
				hasTruth ? "" : "not there",
				!byAgreement && objective(0, "best is", leads.truth),
				h(
					"span.small",
					{ title: byAgreement ? null : lead?.help },
					hasTruth
						? "mean over recordings and seeds of a figure against the truth"
						: "no one knows where people were in this recording",
				),
			),
			card(
				"agreement",
				"Held-out camera",
				"no truth needed",
				h(
					"span.small",
					{ title: known?.help },
					cameras > 1
						? "do runs backwards and without each camera find the same people? A trial whose people miss the boxes of the camera left out is never the best"
						: "one camera cannot be left out: only the run backwards is held against it",
				),
				byAgreement &&
					h(
						"span.small.warn",
						"a tracker can be consistently wrong: look at the best trial before you use it",
					),
			),
		),
		h(
			"div.stack",
			now.objectives.length > 0 && objective(1, "against", others),
			now.objectives.length > 1 && objective(2, "and", others),
		),
	);
}

/* ---------- How far each parameter is varied. ---------- */

/** @typedef {{low: number | null, high: number | null, log: boolean, choices: any[] | null}} Range */
/** @typedef {{changed: () => void, edited: () => void, add: (key: string) => Promise<void>}} On */

/** @param {Server.RangeInfo} range @returns {Range} */
const rangeOf = ({ low, high, log, choices: all }) => ({
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
function parameterRanges(now, known, all, on) {
	const rest = all.filter(({ key }) => !(key in now.parameters));
	const others = rest.map(({ key, label, group }) => [key, `${label} · ${group}`]);
	return h(
		"div.blk",
		rangesBlock(
			`${Object.keys(now.parameters).length} of ${all.length}`,
			Object.entries(now.parameters).map(([key, range]) => parameter(now, known, key, range, on)),
			"leave out",
		),
		chooser("Vary another parameter", [["", "vary another…"], ...others], "", (key) => {
			void on.add(key);
		}),
	);
}

/**
 * @param {Wish} now
 * @param {Server.RangeInfo[]} known
 * @param {string} key
 * @param {Range} range
 * @param {On} on
 */
function parameter(now, known, key, range, { changed, edited }) {
	const found = known.find((one) => one.key === key);
	const label = found?.label ?? key;
	const out = signButton("i-close", `Leave out ${label}`, () => {
		delete now.parameters[key];
		edited();
	});
	const name = h(
		"td",
		{ title: found?.help ?? "" },
		h("span.lab", label),
		" ",
		found && symbolOf(found.symbol),
	);
	if (range.choices)
		return h(
			"tr",
			name,
			h(
				"td.num",
				{ colspan: 3 },
				(found?.choices ?? range.choices).map((one) =>
					h(
						"button.btn.one",
						{
							"aria-pressed": String(range.choices?.includes(one)),
							onclick: () => {
								const left = range.choices?.includes(one)
									? range.choices.filter((other) => other !== one)
									: [...(range.choices ?? []), one];
								range.choices = left;
								edited();
							},
						},
						valueOf(one),
					),
				),
			),
			h("td", out),
		);
	const bounds = { min: found?.minimum, max: found?.maximum };
	/** @param {"low" | "high"} end @param {string} word */
	const bound = (end, word) => {
		const set = (/** @type {number | null} */ value) => (range[end] = value);
		return h("td.num", numberField(changed, `${label} ${word}`, tidy(range[end]), set, bounds));
	};
	return h(
		"tr",
		name,
		bound("low", "from"),
		bound("high", "to"),
		h(
			"td",
			h(
				"button.btn.scale",
				{
					"aria-label": `Scale of ${label}: ${range.log ? "logarithmic" : "linear"}`,
					onclick: () => {
						range.log = !range.log;
						edited();
					},
				},
				range.log ? "log" : "linear",
			),
		),
		h("td", out),
	);
}

/** @param {number | null} value */
const tidy = (value) => (value === null ? null : Number(value.toPrecision(3)));

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
	const body = h("div.scroll");
	const sub = h("span.sub");
	const again = h("button.btn", { onclick: copy }, "Edit a copy");
	const begin = h("button.btn.main.tall2", { onclick: () => wish && start(wish, where) });
	fill(begin, icon("i-play", "s"), "Start");
	const why = h("p.small.why", { role: "status" });
	const foot = h("div.def-foot", why, begin);
	const element = h(
		"section.pane.def",
		{ "aria-label": "Definition" },
		paneHead("What is tried", sub, grow(), again),
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
		edited();
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
		edited();
	}

	/** What can be chosen has changed with what is wished. */
	function edited() {
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
			parameterRanges(now, known, store.get().schema?.parameters ?? [], { changed, edited, add }),
			numbers(now),
			objectiveCards(
				now,
				figures,
				{ hasTruth, cameras: store.get().sequence?.cameras.length ?? 2 },
				edited,
			),
			runsOn(where, { changed, edited }),
		);
	}

	/** @param {Wish} now */
	function named(now) {
		const field = h("input.field", {
			value: now.name,
			"aria-label": "Name of the study",
			maxlength: 60,
			oninput: () => {
				now.name = field.value;
				changed();
			},
		});
		return block("Name", field);
	}

	/** @param {Wish} now */
	function recordings(now) {
		const others = store
			.get()
			.sequences.filter(
				({ name, error }) =>
					!error && !now.recordings.some((place) => place === name || nameOf(place) === name),
			);
		const words = [["", "add a recording…"], ...others.map(({ name }) => [name, name])];
		const more = chooser("Add a recording", words, "", (name) => {
			now.recordings = [...now.recordings, name];
			edited();
		});
		return block(
			"Recordings",
			h(
				"div.tags",
				now.recordings.map((place) =>
					tag(
						nameOf(place),
						now.recordings.length > 1 &&
							(() => {
								now.recordings = now.recordings.filter((one) => one !== place);
								edited();
							}),
					),
				),
			),
			others.length > 0 && more,
		);
	}

	/** @param {Wish} now */
	function numbers(now) {
		const search = chooser("Search", SEARCHES, now.search, (value) => {
			now.search = value;
			changed();
		});
		/** @param {string} word @param {Element} field */
		const labelled = (word, field) => h("label", h("span", word), field);
		/** @param {string} word @param {"trials" | "seeds"} key */
		const count = (word, key) => {
			const set = (/** @type {number | null} */ value) => (now[key] = value ?? 0);
			return labelled(word, numberField(changed, word, now[key], set, { min: 1 }));
		};
		const minutes = numberField(
			changed,
			"At most so many minutes",
			now.minutes,
			(value) => (now.minutes = value),
			{ placeholder: "any" },
		);
		return h(
			"div.blk.four",
			count("Trials", "trials"),
			count("Seeds", "seeds"),
			labelled("Minutes", minutes),
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
