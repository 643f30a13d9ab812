/** The place Study: what is tried, how far it is, what it has found. */
import { claim, capture, capital, choices, fill, h, icon, write } from "../elements/dom.js";
import { getJson } from "../state/api.js";
import { bestTrials } from "./best.js";
import { overview } from "./figures.js";
import { definition } from "./form.js";
import { placeOf } from "./where.js";
import { lasting, lineOf, nameOf } from "./words.js";

/* ---------- How far a study is, and what each worker does. ---------- */

/** @param {{pause: () => void}} on */
function progressPane({ pause }) {
	const element = h("section.pane.prog", { "aria-label": "Progress" });

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
				"div.pgl",
				h(
					"div.big",
					h("b", done),
					h("span.q", trials === null ? " trials so far" : ` of ${trials} trials`),
				),
				h(
					"span.bar.wide",
					{
						"--part": part,
						role: "progressbar",
						"aria-label": "Trials",
						"aria-valuenow": trials === null ? Math.round(100 * part) : done,
						"aria-valuemin": 0,
						"aria-valuemax": trials ?? 100,
					},
					h("i"),
				),
				h("div.q", gone.filter(Boolean).join(" · ")),
			),
			h(
				"div.wk",
				running && status.workers.length
					? status.workers.slice(0, 4).map((worker, k) => workerRow(worker, k))
					: h("div.q", info.words || sentences[0] || ""),
				status.workers.length > 4 && h("div.q", `and ${status.workers.length - 4} more workers`),
			),
			h(
				"button.btn.box.tall2",
				{ "data-key": "Space", onclick: pause, disabled: Boolean(going) || info.state === "done" },
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
		"div.wrow",
		h("span", { title: machine }, `worker ${k + 1}`),
		h("span", words || (trial === null ? "waits" : trial ? `trial ${trial}` : "the default")),
		h("span.q", recording && !words ? `${nameOf(recording)}, seed ${seed}` : ""),
	);
}

const TUNE = "Tune in 5 minutes";
const EVERY_MS = 1000;

/** The choice of a study that is not there yet. */
const NEW = "";

/** @type {Pane} */
export function mountStudy(root, { store, actions }) {
	/** @type {Server.StudyInfo[]} */
	let studies = [];
	let name = NEW;
	/** @type {Server.Study | null} */
	let study = null;
	/** @type {Map<number, Server.TrialInfo>} */
	let trials = new Map();
	let last = 0;
	/** @type {number | null} */
	let chosen = null;
	/** Whether somebody chose it; before that it follows the best. */
	let picked = false;
	/** @type {Server.StudyCost | null} */
	let cost = null;

	const path = (/** @type {string} */ rest = "") => `studies/${encodeURIComponent(name)}${rest}`;

	const list = h("select.field.which", {
		"aria-label": "Study",
		onchange: () => void open(list.value),
	});
	/** @param {string} word @param {string} sign @param {() => void} act @param {string} tip */
	const tool = (word, sign, act, tip) =>
		h("button.btn", { onclick: act, title: tip }, sign && icon(sign, "s"), word);
	const report = h("a.btn", { download: "" }, icon("i-export", "s"), "Report");
	const table = h("a.btn", { download: "" }, icon("i-export", "s"), "Table");
	const remove = tool(
		"Delete",
		"i-trash",
		() => void discard(),
		"Delete this study with its trials",
	);
	const tune = tool(
		TUNE,
		"i-play",
		() => void tuneNow(),
		"Seek better values for what is open, by what matters most, and check them on other seeds",
	);
	const bar = h(
		"div.pane.stu-bar",
		{ role: "toolbar", "aria-label": "Studies" },
		list,
		tool("New", "", () => void begin(), "Another study, from what is on the sliders"),
		tune,
		h("span.grow"),
		report,
		table,
		remove,
	);

	const form = definition(
		{ store, actions },
		{ start: (wish, where) => void start(wish, where), cost: showCost, copy: () => void copy() },
	);
	const progress = progressPane({ pause: () => void pauseOrGoOn() });
	const figures = overview({ choose, narrow: (key, low, high) => void copy(key, low, high) });
	const best = bestTrials(
		{ store, actions },
		{ choose, chosen: () => chosen, name: () => name, path },
	);
	const blank = h("section.pane.stu-blank");
	const main = h(
		"div.stu",
		bar,
		form.element,
		progress.element,
		figures.elements,
		best.element,
		blank,
	);
	fill(root, main);

	async function refreshList() {
		studies = (await getJson("/api/studies")).studies;
		choices(list, [[NEW, "a new study"], ...studies.map((one) => [one.name, lineOf(one)])], name);
	}

	/** @param {string} wanted */
	async function open(wanted) {
		name = wanted;
		list.value = wanted;
		study = null;
		trials = new Map();
		last = 0;
		chosen = null;
		picked = false;
		if (name === NEW) return begin();
		await refresh();
	}

	/** @param {Partial<import("./form.js").Wish>} [from] @param {string[]} [keys] */
	async function begin(from, keys) {
		name = NEW;
		list.value = NEW;
		study = null;
		const asked = keys ? `?keys=${keys.map(encodeURIComponent).join(",")}` : "";
		const draft = await getJson(`/api/studies/draft${asked}`).catch((error) => error);
		if (draft instanceof Error) {
			main.dataset.shows = "nothing";
			return fill(blank, h("h3", "No study yet"), h("p", draft.message));
		}
		main.dataset.shows = "draft";
		form.edit(draft, from);
		tools();
	}

	/** A study of the same, to be changed. @param {string} [narrowed] @param {number} [low] @param {number} [high] */
	async function copy(narrowed, low, high) {
		if (!study) return;
		const { definition: told, varied } = study;
		const parameters = Object.fromEntries(
			varied.map((range) => [
				range.key,
				{
					low: range.key === narrowed ? (low ?? range.low) : range.low,
					high: range.key === narrowed ? (high ?? range.high) : range.high,
					log: range.log,
					choices: range.choices.length ? [...range.choices] : null,
				},
			]),
		);
		await begin(
			{
				recordings: told.recordings,
				parameters,
				trials: told.trials,
				seeds: Array.isArray(told.seeds) ? told.seeds.length : told.seeds,
				minutes: told.minutes ?? null,
				search: told.search,
				objectives: told.objectives,
			},
			varied.map(({ key }) => key),
		);
	}

	/** @param {Server.StudyCost | null} told */
	function showCost(told) {
		cost = told;
		if (name !== NEW) return;
		fill(
			blank,
			h("h3", "What it will take"),
			h(
				"p",
				cost
					? `${capital(cost.words)}; ${(cost.bytes / 1e6).toFixed(1)} MB on disk.`
					: "See what is said beside Start.",
			),
			h("h3", "What a study is"),
			h(
				"p",
				"Many runs of the same recordings, each a trial with other values of the chosen parameters. It finds which values track better, and which parameters matter at all. Trial 0 is always the default.",
			),
			h("h3", "What to do first"),
			h(
				"ol.firsts",
				h(
					"li",
					h("b", TUNE),
					" does all of it for the open recording: it varies what matters most and checks the best values on other seeds.",
				),
				h(
					"li",
					"Or say it yourself, at the left: recordings, parameters with their ranges, by which figure a trial is better. ",
					h("b", "Start"),
					" runs it, also while you work elsewhere.",
				),
				h(
					"li",
					"As trials end, each is a dot here: its figures against each other, what matters, each parameter, and a table. ",
					h("b", "Use"),
					" puts the best values on the sliders.",
				),
			),
		);
	}

	/** @param {import("./form.js").Wish} wish @param {import("./where.js").Where} where */
	async function start(wish, where) {
		const made = await actions.ask("POST", "studies", wish);
		if (!made) return;
		await refreshList();
		await open(made.info.name);
		await go("/start", placeOf(where));
	}

	async function tuneNow() {
		tune.disabled = true;
		write(/** @type {Node} */ (tune.lastChild), "Starting…");
		const made = await actions.ask("POST", "studies/tune", {});
		write(/** @type {Node} */ (tune.lastChild), TUNE);
		tune.disabled = false;
		if (!made) return;
		await refreshList();
		await open(made.info.name);
	}

	async function discard() {
		if (!(await actions.ask("DELETE", path()))) return;
		await refreshList();
		await open(studies[0]?.name ?? NEW);
	}

	async function pauseOrGoOn() {
		if (!study || going || study.info.state === "done") return;
		await go(study.info.state === "running" ? "/stop" : "/start", {});
	}

	/** What the server is just asked to do with it. @type {"" | "Starting…" | "Pausing…"} */
	let going = "";
	/** @param {"/start" | "/stop"} to @param {Partial<import("./where.js").Where>} place */
	async function go(to, place) {
		going = to === "/start" ? "Starting…" : "Pausing…";
		if (study) progress.show(study, going);
		await actions.ask("POST", path(to), place);
		going = "";
		if (study) progress.show(study, going);
		await refresh();
	}

	let busy = false;
	async function refresh() {
		if (name === NEW || busy) return;
		busy = true;
		const wanted = name;
		try {
			const told = await getJson(`/api/${path()}`);
			const more = await getJson(`/api/${path(`/trials?after=${last}`)}`);
			if (name !== wanted) return;
			const begun = !study;
			study = told;
			for (const trial of more.trials) trials.set(trial.number, trial);
			last = more.last;
			if (!picked && study) chosen = study.best;
			if (begun && study) form.locked(study);
			show(begun || more.trials.length > 0);
		} catch (error) {
			// The socket tells whether the server is there.
			if (name === wanted && !study) fill(blank, h("p", /** @type {Error} */ (error).message));
		} finally {
			busy = false;
		}
	}

	function tools() {
		report.href = `/api/${path("/export/report.html")}`;
		table.href = `/api/${path("/export/trials.csv")}`;
		for (const part of [report, table, remove]) part.hidden = name === NEW;
		remove.disabled = study?.info.state === "running";
	}

	/** @param {boolean} news whether trials ended */
	function show(news) {
		if (!study) return;
		main.dataset.shows = "study";
		tools();
		form.state(study.info);
		for (const option of list.options)
			if (option.value === study.info.name) write(option, lineOf(study.info));
		progress.show(study, going);
		if (!news) return;
		const done = [...trials.values()].sort((a, b) => a.ended - b.ended);
		best.show(study, done);
		figures.show(study, done, chosen);
	}

	/** @param {number} number */
	function choose(number) {
		chosen = number;
		picked = true;
		show(true);
		best.rows.reveal(number);
	}

	/** What a key does here. @type {Record<string, () => void>} */
	const KEYS = {
		" ": () => void pauseOrGoOn(),
		ArrowDown: () => move(1),
		ArrowUp: () => move(-1),
		Enter: () => best.use(),
		c: () => void best.compare(),
		Escape: () => (location.hash = "#tune"),
	};
	/** @param {number} by */
	function move(by) {
		const next = best.rows.beside(chosen, by);
		if (next !== null) choose(next);
	}
	capture(document, "keydown", (event) => {
		if (store.get().place !== "study" || document.querySelector("dialog[open]")) return;
		const target = /** @type {HTMLElement} */ (event.target);
		if (event.ctrlKey || event.metaKey || event.altKey) return;
		if (target.matches("input, select")) {
			if (event.key === "Escape") (target.blur(), event.stopPropagation());
			return;
		}
		const act = KEYS[event.key];
		if (!act || (target.closest("button, a, .chart") && ["Enter", " "].includes(event.key))) return;
		act();
		claim(event);
	});

	/** @type {Timer} */
	let clock;
	store.watch(["place", "study"], ({ place, study: told }) => {
		clearInterval(clock);
		if (place !== "study") return;
		if (told && told.name === name) void refresh();
		clock = setInterval(() => {
			if (study?.info.state === "running" || (study && trials.size < study.info.done))
				void refresh();
		}, EVERY_MS);
	});
	store.on(["place"], ({ place }) => {
		if (place === "study") void refreshList();
	});
	/** Somebody comes from a run, to try values around its own. */
	const wanted = () => {
		if (!store.get().wantsStudy) return false;
		store.set({ wantsStudy: false });
		void begin();
		return true;
	};
	store.on(["wantsStudy"], () => void wanted());
	void refreshList().then(() => {
		if (wanted()) return;
		void open(studies.find(({ state }) => state === "running")?.name ?? studies[0]?.name ?? NEW);
	});
}
