/** The figures of a study: its trials, what matters, each parameter; the table says the same. */
import { chart } from "../elements/chart.js";
import { fill, h, write } from "../elements/dom.js";
import { grow, paneHead, segment, symbolOf } from "../elements/drawn.js";
import { many } from "../library/words.js";
import { figureOf, titledOf, valueOf } from "./words.js";

/** Trials that are shown against each parameter: a place for each. */
const MOST_PARAMETERS = 6;

/**
 * @typedef {{name: string, of: Server.ObjectiveInfo, at: (trial: Server.TrialInfo) => number | null | undefined}} Measure
 * @typedef {{best: number | null, chosen: number | null}} Which
 * @import { Mark, Point } from "../elements/chart.js"
 */

/** A figure as the cards say it. @param {Measure} measure @param {Server.TrialInfo} trial */
const saying = ({ name, of, at }, trial) => `${name} ${figureOf(at(trial), of)} ${of.unit}`.trim();

/**
 * Points of trials, older ones fainter; the default is a diamond, the best a dot, the chosen one
 * has a ring.
 * @param {Server.TrialInfo[]} trials
 * @param {Which} which
 * @param {(trial: Server.TrialInfo) => Omit<Point, "key">} place
 * @param {number} size  radius of a dot, CSS pixels
 * @param {(trial: Server.TrialInfo) => string} [note]  of the default and the best
 * @param {Mark[]} [between]  drawn over the points and under the marks
 * @returns {Mark[]}
 */
function points(trials, { best, chosen }, place, size, note, between = []) {
	const point = (/** @type {Server.TrialInfo} */ trial, word = `trial ${trial.number}`) => {
		const { says, ...rest } = place(trial);
		return { ...rest, key: trial.number, says: `${word}\n${says}` };
	};
	/** @param {number | null} number @param {string} word @param {Omit<Mark, "points" | "kind">} look */
	const marked = (number, word, look, noted = note ?? null) => {
		const of = trials.filter((trial) => trial.number === number);
		/** @type {Mark} */
		const mark = {
			kind: "dots",
			points: of.map((trial) => ({
				...point(trial, word),
				note: noted ? `${word}: ${noted(trial)}` : "",
			})),
			...look,
		};
		return mark;
	};
	const large = note ? 5.5 : 4;
	return [
		{
			kind: "dots",
			colour: "ink-3",
			size,
			points: trials.map((trial, k) => ({
				...point(trial),
				strength: 0.35 + (0.5 * k) / trials.length,
			})),
		},
		...between,
		...(chosen === null
			? []
			: [
					marked(
						chosen,
						`trial ${chosen}, chosen`,
						{ colour: "accent", shape: "ring", size: large + 3 },
						null,
					),
				]),
		marked(0, "default", { colour: "ink-1", shape: "diamond", size: large + 1 }),
		...(best ? [marked(best, `best, trial ${best}`, { colour: "accent", size: large })] : []),
	];
}

/**
 * The middle half of the values and as much again, so that a lost trial does not flatten the rest;
 * what has to be seen is in it, and a little beyond.
 * @param {number[]} values
 * @param {number[]} seen
 */
function core(values, seen) {
	const sorted = [...values].sort((a, b) => a - b);
	const at = (/** @type {number} */ share) =>
		sorted[Math.round(share * (sorted.length - 1))] ?? Number.NaN;
	const [low, high] = [at(0.25), at(0.75)];
	const reach = 3 * (high - low) || Infinity;
	const inside = sorted.filter((value) => value >= low - reach && value <= high + reach);
	const [least, most] = [Math.min(...inside, ...seen), Math.max(...inside, ...seen)];
	const more = (most - least || Math.abs(most) || 1) * 0.08;
	return [least - more, most + more];
}

/** Those of an axis by their values and by those that have to be seen.
 * @param {Server.TrialInfo[]} trials @param {Measure} of @param {Which} which */
function endsOf(trials, { at }, { best }) {
	const values = (/** @type {Server.TrialInfo[]} */ some) => some.map((one) => Number(at(one)));
	return core(values(trials), values(trials.filter(({ number }) => !number || number === best)));
}

/**
 * The trials by two figures, with those that nothing beats in both.
 * @param {Server.TrialInfo[]} trials
 * @param {Measure} x
 * @param {Measure} y
 * @param {Which} which
 */
function scatter(trials, x, y, which) {
	const known = trials.filter((trial) => x.at(trial) != null && y.at(trial) != null);
	const [across, up] = [x, y].map((of) => endsOf(known, of, which));
	const place = (/** @type {Server.TrialInfo} */ trial) => ({
		x: Number(x.at(trial)),
		y: Number(y.at(trial)),
		says: `${saying(y, trial)}\n${saying(x, trial)}`,
	});
	const outside = known
		.map(place)
		.filter(
			(one) => one.x < across[0] || one.x > across[1] || one.y < up[0] || one.y > up[1],
		).length;
	const front = unbeaten(known, x, y);
	const stairs = front.map(place).map(({ x, y }) => ({ x, y }));
	const worst = up[y.of.higher ? 0 : 1];
	const [first, last] = [stairs[0], stairs.at(-1)];
	if (first && last) {
		stairs.unshift(x.of.higher ? { x: across[0], y: first.y } : { x: first.x, y: worst });
		stairs.push(x.of.higher ? { x: last.x, y: worst } : { x: across[1], y: last.y });
	}
	const titled = (/** @type {Measure} */ { of }) =>
		`${titledOf(of)}, ${of.higher ? "more" : "less"} is better`;
	/** @type {Mark[]} */
	const beaten = [
		{ kind: "steps", colour: "accent", size: 1.25, rises: x.of.higher, points: stairs },
		{
			kind: "dots",
			colour: "accent",
			points: front.map((trial) => {
				const { says, ...rest } = place(trial);
				return { ...rest, key: trial.number, says: `trial ${trial.number}, front\n${says}` };
			}),
		},
	];
	const note = (/** @type {Server.TrialInfo} */ trial) => figureOf(y.at(trial), y.of);
	return {
		x: { ends: across, title: titled(x) },
		y: { ends: up, title: titled(y) },
		marks: points(known, which, place, 3, note, beaten),
		margin: [58, 20, 18, 40],
		aside: outside ? `${outside} ${outside === 1 ? "trial lies" : "trials lie"} outside` : "",
	};
}

/**
 * Those that no other beats in one of two figures without losing in the other, by the first.
 * @param {Server.TrialInfo[]} trials
 * @param {Measure} x
 * @param {Measure} y
 */
export function unbeaten(trials, x, y) {
	const worth = (/** @type {Measure} */ { of, at }, /** @type {Server.TrialInfo} */ trial) =>
		(of.higher ? 1 : -1) * Number(at(trial));
	const free = trials
		.filter(({ vetoed }) => !vetoed)
		.sort((a, b) => worth(x, b) - worth(x, a) || worth(y, b) - worth(y, a));
	let top = -Infinity;
	const found = free.filter((trial) => {
		const now = worth(y, trial);
		if (now <= top) return false;
		top = now;
		return true;
	});
	return x.of.higher ? found.reverse() : found;
}

/**
 * The best figure over the trials; what is still to come stays empty.
 * @param {Server.TrialInfo[]} trials
 * @param {Measure} y
 * @param {number} of  trials in all
 */
function bestSoFar(trials, y, of) {
	/** @type {Point[]} */
	const best = [];
	trials.forEach((trial, x) => {
		const value = trial.vetoed ? null : y.at(trial);
		const before = best.at(-1)?.y;
		if (value == null && before === undefined) return;
		const now = Math[y.of.higher ? "max" : "min"](value ?? before ?? 0, before ?? value ?? 0);
		best.push({ x, y: now, key: x, says: `after ${many(x, "trial")}\n${figureOf(now, y.of)}` });
	});
	const [low, high] = core(
		[],
		best.map(({ y }) => y),
	);
	/** @type {Mark[]} */
	const marks = [
		{
			kind: "band",
			colour: "p-grid",
			points: [trials.length, of].map((x) => ({ x, y: high })),
		},
		{ kind: "steps", colour: "ink-1", size: 1.5, points: best },
	];
	return { x: { ends: [0, of] }, y: { ends: [low, high] }, marks, margin: [48, 6, 12, 20] };
}

/**
 * One parameter against the leading figure.
 * @param {Server.TrialInfo[]} trials
 * @param {Server.RangeInfo} range
 * @param {Measure} y
 * @param {Which} which
 */
function against(trials, range, y, which) {
	const known = trials.filter((trial) => y.at(trial) != null);
	const of = (/** @type {Server.TrialInfo} */ trial) => trial.values[range.key] ?? range.default;
	const { low, high, kind, log } = range;
	const numbers = (kind === "float" || kind === "int") && low !== null && high !== null;
	const words = [...new Set([...range.choices, ...known.map(of)].map(valueOf))];
	const place = (/** @type {Server.TrialInfo} */ trial) => ({
		x: numbers ? Number(of(trial)) : words.indexOf(valueOf(of(trial))),
		y: Number(y.at(trial)),
		says: `${range.label} ${valueOf(of(trial))}\n${saying(y, trial)}`,
	});
	return {
		x: numbers
			? { ends: [low, high], log }
			: {
					ends: [-0.5, words.length - 0.5],
					ticks: words.map((word, k) => /** @type {const} */ ([k, word])),
				},
		y: { ends: endsOf(known, y, which) },
		marks: points(known, which, place, 2),
		margin: [44, 4, 14, 22],
		numbers,
	};
}

/** How much each parameter matters, and how sure that is. @param {Server.Study} study */
function shares({ importance, varied }) {
	const most = Math.max(...importance.map(({ share, spread }) => share + spread), 0.01);
	const percent = (/** @type {number} */ share) => `${Math.round(share * 100)} %`;
	const rows = importance.map(({ key, share, spread }, y) => {
		const range = varied.find((one) => one.key === key);
		const says = `${range?.label ?? key}\n${percent(share)} ± ${percent(spread)}`;
		return { range, name: range?.label ?? key, share, spread, y, says };
	});
	/** @type {Mark[]} */
	const marks = [
		{
			kind: "bars",
			colour: "p-loc",
			points: rows.map(({ share, y, says }) => ({ x: share, y, low: 0, key: y, says })),
		},
		{
			kind: "bars",
			colour: "ink-1",
			size: 1,
			points: rows.map(({ share, spread, y }) => ({
				x: share + spread,
				y,
				low: Math.max(0, share - spread),
			})),
		},
	];
	return {
		x: { ends: [0, most], ticks: [] },
		y: {
			ends: [rows.length - 0.5, -0.5],
			ticks: rows.map(({ range, name, share, y }) => {
				const words = h(
					"span.lab",
					{ title: range && `${name}: ${range.help}` },
					h("span", name),
					range && symbolOf(range.symbol),
					h("b", percent(share)),
				);
				return /** @type {const} */ ([y, words]);
			}),
		},
		marks,
		margin: [176, 0, 12, 0],
	};
}

/** Letters of a figure's name beyond which it is not said again beside others. */
const LONG = 16;

/**
 * @param {object} on
 * @param {(number: number) => void} on.choose
 * @param {(key: string, low: number, high: number) => void} on.narrow
 */
export function overview({ choose, narrow }) {
	/** @type {{study: Server.Study | null, done: Server.TrialInfo[], chosen: number | null}} */
	let shown = { study: null, done: [], chosen: null };
	/** Key of the figure along the other axis. */
	let across = "";
	const axes = h("div.seg", { role: "group", "aria-label": "Axes" });
	const pareto = chart();
	const scat = h(
		"section.pane.scat",
		{ "aria-label": "Trials" },
		paneHead("Trials", axes, grow(), legend()),
		pareto.element,
	);
	const bars = chart();
	const rows = h("div.ibars", bars.element);
	const aside = h("p.small.ifoot");
	const of = h("span.sub");
	const since = h("span.q");
	const sofar = chart();
	const matters = h(
		"section.pane.imp",
		{ "aria-label": "What matters" },
		paneHead("What matters", grow(), of),
		rows,
		aside,
		h("div.sofar", h("div.mh", h("span", "Best so far"), grow(), since), sofar.element),
	);
	const each = h("h2.pane-title", "Each parameter");
	const grid = h("div.mgrid");
	const narrowing = h("span.sub");
	/** Of each shown parameter by its key: its chart, and the value of the best. */
	const cells = new Map();
	const multiples = h(
		"section.pane.mult",
		{ "aria-label": "Each parameter" },
		paneHead(each, grow(), narrowing),
		grid,
	);

	/** A figure of the study by its place among the objectives. @param {number} k @returns {Measure} */
	const measure = (k) => ({
		name: shown.study?.objectives[k].name ?? "",
		of: /** @type {Server.ObjectiveInfo} */ (shown.study?.objectives[k]),
		at: (trial) => trial.objectives?.[k],
	});

	/** What the other axis may show. @returns {Measure[]} */
	function measures() {
		/** @type {Measure[]} */
		const more = (shown.study?.objectives ?? []).map((_, k) => measure(k)).slice(1);
		const beside = shown.study?.beside ?? [];
		// the camera that was left out, else where people are
		const of = beside.find((one) => one.of === "agreement") ?? beside.at(-1);
		if (of && (of.of === "agreement" || !more.length))
			more.push({ name: of.name, of, at: ({ figures }) => figures[of.key] });
		more.push({
			name: "time",
			of: {
				key: "seconds",
				name: "time",
				help: "",
				higher: false,
				unit: "s",
				digits: 1,
				of: "run",
			},
			at: ({ seconds }) => seconds,
		});
		return more;
	}

	/** @param {Server.Study} now */
	function showMatters(now) {
		const { importance, importance_trials: count, objectives } = now;
		const { name } = objectives[0];
		const label = `share of ${name.length > LONG ? "the" : `${name}'s`} variance`;
		fill(of, label);
		rows.style.setProperty("--rows", String(importance.length));
		rows.hidden = !importance.length;
		bars.show({ label: `What matters: ${label}`, ...shares(now) });
		write(
			aside,
			importance.length
				? `The thin line is how sure that is with ${count} trials.`
				: "Too few trials to tell yet.",
		);
	}

	function draw() {
		const { study: now, done, chosen } = shown;
		if (!now) return;
		if (!done.length) {
			// of the study that was shown before nothing stays
			pareto.clear("The default is run first, then the trials come.");
			sofar.clear();
			cells.clear();
			for (const part of [axes, since, grid]) fill(part);
			return;
		}
		const y = measure(0);
		const others = measures();
		const x = others.find(({ of: { key } }) => key === across) ?? others[0];
		const words = others.map(
			({ of: { key }, name: word }) =>
				/** @type {const} */ ([
					key,
					y.name.length > LONG ? `against ${word}` : `${y.name} · ${word}`,
				]),
		);
		fill(
			axes,
			segment(words, x.of.key, (key) => {
				across = key;
				draw();
			}),
		);
		const complete = done.filter(({ state }) => state === "complete");
		const told = { best: now.best, chosen };
		const top = now.best === null ? undefined : done.find(({ number }) => number === now.best);
		const worth = figureOf(top?.objectives?.[0], y.of);
		const label = `${y.name} against ${x.name} of ${complete.length} trials; the best is ${now.best ? `trial ${now.best}` : "the default"} with ${worth}`;
		pareto.show({ label, choose, ...scatter(complete, x, y, told) });
		sofar.show({
			label: `Best ${y.name} over the trials: ${worth} now`,
			...bestSoFar(done, y, now.info.trials ?? done.length),
		});
		const after = top ? done.length - 1 - done.findIndex(({ number }) => number === top.number) : 0;
		fill(
			since,
			now.best === 0
				? "the default is as good"
				: after
					? `nothing better for ${after} ${after === 1 ? "trial" : "trials"}`
					: "",
		);
		fill(each, `Each parameter against ${y.name}`);
		const running = now.info.state === "running";
		fill(narrowing, running ? "" : "drag over a range to try a narrower one");
		const ranked = [...now.varied]
			.sort((a, b) => share(now, b.key) - share(now, a.key))
			.slice(0, MOST_PARAMETERS);
		if (ranked.some(({ key }, k) => [...cells.keys()][k] !== key)) {
			cells.clear();
			fill(grid, ranked.map(cell));
		}
		for (const range of ranked) {
			const value = top && range.key in top.values ? top.values[range.key] : range.default;
			const { figure, best } = cells.get(range.key);
			write(best, valueOf(value));
			const { numbers, ...drawn } = against(complete, range, y, told);
			figure.show({
				label: `${range.label} against ${y.name}`,
				choose,
				brush:
					numbers && !running
						? (/** @type {number} */ low, /** @type {number} */ high) =>
								narrow(range.key, low, high)
						: null,
				...drawn,
			});
		}
	}

	/** @param {Server.Study} now @param {string} key */
	const share = (now, key) => now.importance.find((one) => one.key === key)?.share ?? 0;

	/** @param {Server.RangeInfo} range */
	function cell({ key, label, symbol, help }) {
		const [figure, best] = [chart(), h("b")];
		cells.set(key, { figure, best });
		return h(
			"div.mp",
			h(
				"div.mh",
				{ title: `${label}: ${help}` },
				h("span.lab", h("span", label), symbolOf(symbol)),
				grow(),
				h("span.q", "best"),
				best,
			),
			figure.element,
		);
	}

	/**
	 * @param {Server.Study} study
	 * @param {Server.TrialInfo[]} done  in the order in which they ended
	 * @param {number | null} chosen
	 */
	function show(study, done, chosen) {
		shown = { study, done, chosen };
		showMatters(study);
		draw();
	}

	return { elements: [scat, matters, multiples], show };
}

/** What the signs of the figure mean. */
function legend() {
	const signs = [
		["dot", "trial"],
		["line", "front"],
		["diamond", "default"],
		["best", "best"],
	];
	return h(
		"div.legend",
		signs.map(([kind, word]) => h("span", h("i", { class: `sign ${kind}` }), word)),
	);
}
