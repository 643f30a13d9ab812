/** The inspector's tab Place: one doubtful moment in pictures, what it could be, what to do. */
import { palette } from "../draw/canvas.js";
import { all, capital, colourIndex, fill, h, icon, idTag } from "../elements/dom.js";
import { chooser, grow, segment } from "../elements/drawn.js";
import { commandOf, keyLabel, perform } from "../state/commands.js";
import { scoresOf, shownVersion } from "../state/events.js";
import { drawCrop } from "./crops.js";
import {
	camerasFor,
	filmSteps,
	distinct,
	isOfTwo,
	percent,
	proposed,
	standsFor,
	unbroken,
} from "./words.js";

/* ---------- The film of somebody who may be missing: where each camera would have him. */

/** @typedef {Doubt["sights"]} Sights */

/** A camera's, in the order of steps. @param {Sights} sights @param {number} camera */
const of = (sights, camera) => sights.filter((one) => one.camera === camera);

/** The cameras, those first that would have him at most of the steps. @param {Sights} sights @param {number} cameras */
const camerasOf = (sights, cameras) =>
	Array.from({ length: cameras }, (_, camera) => camera).sort(
		(a, b) => of(sights, b).length - of(sights, a).length || a - b,
	);

/**
 * Fill a film with what a camera shows there.
 * @param {HTMLElement} film @param {Sights} sights @param {number} camera
 * @param {{views: PageState["cameras"], crops: ReturnType<typeof import("./crops.js").createCrops>, seek: (step: number) => void}} page
 * @returns {number[]} its steps
 */
function fillSights(film, sights, camera, { views, crops, seek }) {
	const own = of(sights, camera);
	const shown = filmSteps(0, own.length - 1, { frames: own.length, fps: 1 }).map((k) => own[k]);
	const name = views[camera]?.name ?? "";
	film.ariaLabel = `Pictures of who may be missing by ${name}`;
	film.style.setProperty("--rows", "1");
	const canvases = shown.map(() => h("canvas", { "aria-hidden": "true" }));
	fill(
		film,
		...shown.map(({ step }, k) => h("span.fs.in", { "--column": k + 2, "data-at": step }, step)),
		h("span.fid", { "--row": 2 }, "?"),
		...shown.map(({ step }, k) =>
			h(
				"button.fr.in",
				{
					"--row": 2,
					"--column": k + 2,
					"--c": "var(--warn)",
					"data-at": step,
					"aria-label": `Step ${step} by ${name}`,
					onclick: () => seek(step),
				},
				canvases[k],
			),
		),
	);
	shown.forEach(async ({ step, box }, k) => {
		const bitmap = await crops.pictureOf(camera, step);
		if (canvases[k].isConnected) drawCrop(canvases[k], bitmap, box, palette().id(1));
	});
	return shown.map(({ step }) => step);
}

/** People whose pictures are shown. */
const ROWS = 2;
/** What can be done: a command, its sign and its word. */
const ACTS = /** @type {const} */ ([
	["check-exchange", "i-exchange", "Exchange"],
	["check-split", "i-split", "Split here"],
	["check-join", "i-join", "Join with…"],
	["check-nobody", "i-trash", "Delete"],
	["check-here", "i-here", "Place…"],
]);
/** What does that an alternative says; others are just said. @type {[RegExp, string][]} */
const DOES = [
	[/^exchanged/, "check-exchange"],
	[/goes on/, "check-join"],
	[/^two/, "check-split"],
	[/^nobody/, "check-nobody"],
];
/** Where there is little room their words go first. */
const SHORT = ["check-here", "check-nobody", "check-skip"];
/** What is done with those who are there, not with who is missing. */
const OF_OTHERS = ["check-exchange", "check-split"];
/** The kinds of doubt about somebody who is not there. */
const OF_NOBODY = ["missing", "begins", "ends"];
/** So many alternatives stand side by side, and in a pane narrower than that; others are in a list. */
const BESIDE = { wide: 3, narrow: 2, below: 460 };

/** What is to be done while somebody is placed. */
/** @param {NonNullable<ReturnType<Check["state"]["get"]>["placing"]>} placing */
function placingWords({ track, step, clicks }) {
	if (clicks.length === 1) return "One picture: feet on the floor. Enter says it, Esc leaves it.";
	if (clicks.length) return "Two pictures. Enter says it, Esc leaves it.";
	const who = track === null ? "somebody stands" : `track ${track} stands`;
	return `Click where ${who} at step ${step}, in one picture or in two. Esc leaves it.`;
}

/**
 * @param {HTMLElement} root @param {Context} context @param {Check} check
 * @param {ReturnType<typeof import("./crops.js").createCrops>} crops
 */
export function mountPlace(root, { store, actions, playback }, check, crops) {
	const { state } = check;
	const head = h("div.plhead");
	const film = h("div.film", { role: "group" });
	const why = h("p.why");
	const cameras = h("div.seg", { role: "group", "aria-label": "Camera of the pictures" });
	const acts = h("div.acts", { role: "toolbar", "aria-label": "Actions" });
	const blank = h("div.blank");
	fill(root, h("div.pl", head, film, h("div.whyline", why, cameras), acts), blank);
	/** By which camera; null: the one that sees them best. @type {number | null} */
	let by = null;
	let drawn = 0;
	/** @type {number[]} */
	let steps = [];

	/** @param {string} name @param {string} sign @param {string} word @param {boolean} main */
	const button = (name, sign, word, main) => {
		const command = commandOf(name);
		return h(
			"button",
			{
				class: `btn ${main ? "main" : "box"}${SHORT.includes(name) ? " short" : ""}`,
				"data-tip": command.title,
				onclick: () => perform(command, actions),
			},
			icon(sign),
			h("span.w", word),
			h(
				"kbd",
				command.keys
					.slice(0, 1)
					.map((key) =>
						keyLabel(key).replace("Shift ", "⇧").replace("Enter", "↵").replace("Delete", "Del"),
					)
					.join(),
			),
		);
	};

	/** @param {string} label @param {number | null} value @param {(turn: -1 | 1) => void} act */
	const stepper = (label, value, act) =>
		h(
			"span.stepper",
			{ role: "group", "aria-label": label },
			h(
				"button",
				{ "aria-label": `${label}: earlier`, onclick: () => act(-1) },
				icon("i-prev", "s"),
			),
			h("span", value ?? "end"),
			h("button", { "aria-label": `${label}: later`, onclick: () => act(1) }, icon("i-next", "s")),
		);

	/** An end of an exchange moves; behind the last step it is for good. @param {0 | 1} end @param {-1 | 1} turn */
	function moveEnd(end, turn) {
		const { chosen, ends } = state.get();
		if (!chosen) return;
		const { frames } = store.get();
		/** @type {[number, number | null]} */
		const next = ends ? [...ends] : [chosen.last, null];
		if (end === 0) next[0] = Math.max(1, Math.min(frames - 1, next[0] + turn));
		else if (next[1] === null) next[1] = turn < 0 ? Math.max(next[0], chosen.last) : null;
		else next[1] = next[1] + turn > frames - 1 ? null : next[1] + turn;
		if (next[1] !== null) next[1] = Math.max(next[0], next[1]);
		state.set({ ends: next });
		playback.seek(next[end] ?? next[0]);
	}

	function heads() {
		const { chosen, other, queue, ends, placing } = state.get();
		blank.hidden = Boolean(chosen);
		if (!chosen && placing) return fill(blank, h("p", placingWords(placing)));
		if (!chosen) {
			fill(
				blank,
				h("h3", queue?.doubts.length ? "No place is chosen" : "No place to look at"),
				h(
					"p",
					queue?.doubts.length
						? "Y goes to the next one."
						: `Corrections can be made anywhere: select a track, then ${keyLabel(commandOf("check-menu").keys[0])} or its menu.`,
				),
			);
			return;
		}
		const number = (queue?.doubts.findIndex(({ id }) => id === chosen.id) ?? -1) + 1;
		const [from, to] = ends ?? [
			isOfTwo(chosen) && chosen.kind === "exchange" ? chosen.last : chosen.first,
			isOfTwo(chosen) && chosen.kind === "exchange" ? null : chosen.last,
		];
		fill(
			head,
			h("span.qn.on", { "aria-hidden": "true" }, number || "–"),
			h("span.q", "steps"),
			...(isOfTwo(chosen)
				? [
						stepper("From step", from, (turn) => moveEnd(0, turn)),
						h("span.q", "to"),
						stepper("To step", to, (turn) => moveEnd(1, turn)),
					]
				: [
						h(
							"span",
							chosen.first === chosen.last ? chosen.first : `${chosen.first} – ${chosen.last}`,
						),
					]),
			grow(),
			choice(chosen, other),
		);
		head
			.querySelector(".seg [aria-pressed=true], .seg .on")
			?.scrollIntoView({ block: "nearest", inline: "nearest" });
		words();
		buttons();
	}

	/** What the place may be: the likeliest side by side, the others in a list. @param {Doubt} doubt @param {number} other */
	function choice(doubt, other) {
		const all = distinct(doubt, other);
		const most = root.clientWidth < BESIDE.below ? BESIDE.narrow : BESIDE.wide;
		const far = all.slice(all.length > most + 1 ? most : all.length);
		const beside = all.slice(0, all.length - far.length);
		const listed = far.some(([, k]) => k === other);
		/** @param {Doubt["alternatives"][number]} one */
		const likely = ({ words, probability }) => `${words}: ${percent(probability)}`;
		const more = chooser(
			"Other alternatives",
			[["", `${far.length} more`], ...far.map(([one, k]) => [k, likely(one)])],
			listed ? other : "",
			(value) => check.show(Number(value)),
		);
		more.className = listed ? "on" : "";
		more.options[0].hidden = true;
		return h(
			"div.seg",
			{ role: "group", "aria-label": "Shown" },
			segment(
				beside.map(([one, k]) => /** @type {const} */ ([k, one.words, likely(one)])),
				other,
				check.show,
			),
			far.length > 0 && more,
		);
	}

	function words() {
		const { chosen, placing, other } = state.get();
		if (!chosen) return;
		if (placing) return fill(why, placingWords(placing));
		const { words: what, probability } = chosen.alternatives[other] ?? chosen.alternatives[0];
		const switches = scoresOf(store.get())?.series.switches.filter(
			({ step, before, track }) =>
				step >= (steps[0] ?? 0) &&
				step <= (steps[steps.length - 1] ?? 0) &&
				[before, track].some((id) => chosen.tracks.includes(id)),
		).length;
		why.title = chosen.why;
		fill(
			why,
			h("b", unbroken(chosen.title)),
			`${chosen.title.endsWith("?") ? "" : "."} ${unbroken(capital(chosen.why))}.`,
			h(
				"span.q",
				` ${what}: ${percent(probability)}.`,
				switches
					? ` Truth counts ${switches === 1 ? "a switch" : `${switches} switches`} here.`
					: "",
			),
		);
	}

	function buttons() {
		const { chosen, other, ends } = state.get();
		if (!chosen) return;
		const best = other || proposed(chosen);
		const alternative = chosen.alternatives[best]?.words ?? "";
		const does = DOES.find(([word]) => word.test(alternative))?.[1] ?? "check-apply";
		const main = ends ? "check-exchange" : best ? does : "check-confirm";
		fill(
			acts,
			...ACTS.filter(([name]) => !OF_NOBODY.includes(chosen.kind) || !OF_OTHERS.includes(name)).map(
				([name, sign, word]) =>
					button(name, sign, name === main && name === "check-join" ? "Join" : word, name === main),
			),
			grow(),
			main === "check-apply" &&
				(OF_NOBODY.includes(chosen.kind)
					? button(main, "i-here", capital(alternative), true)
					: button(main, "i-tick", "Apply", true)),
			button("check-skip", "i-next", "Skip", false),
			button("check-confirm", "i-tick", "Confirm", main === "check-confirm"),
		);
	}

	/** Draw the film of what is chosen. */
	async function roll() {
		const turn = (drawn += 1);
		const { chosen, preview } = state.get();
		if (!chosen || store.get().place !== "check") return;
		const { frames, fps, cameras: views } = store.get();
		const version = shownVersion(store.get());
		steps = filmSteps(chosen.first, chosen.last, { frames, fps });
		if (chosen.sights.length) {
			const best = camerasOf(chosen.sights, views.length);
			const camera = by !== null && by < views.length ? by : best[0];
			numbers(best, camera);
			steps = fillSights(film, chosen.sights, camera, { views, crops, seek: playback.seek });
			return mark();
		}
		const ids = (
			preview?.tracks.length
				? [...new Set([...chosen.tracks, ...preview.tracks.map(({ id }) => id)])]
				: chosen.tracks
		).slice(0, ROWS);
		const results = await Promise.all(steps.map(crops.resultAt));
		if (turn !== drawn || version !== shownVersion(store.get())) return;
		const best = camerasFor(results, chosen.tracks, views.length);
		const camera = by !== null && by < views.length ? by : (best[0] ?? 0);
		numbers(best, camera);
		const name = views[camera]?.name ?? "";
		film.ariaLabel = `Pictures of ${ids.join(" and ")} by ${name}`;
		const inside = (/** @type {number} */ step) => step >= chosen.first && step <= chosen.last;
		/** @type {{canvas: HTMLCanvasElement, cell: HTMLElement, step: number, box: Box | null, id: number}[]} */
		const cells = [];
		const rows = ids.flatMap((id, row) => [
			h("span.fid", { "--row": row + 2 }, idTag(id)),
			...steps.map((step, k) => {
				const result = results[k];
				const now = preview ? standsFor(preview, id, result) : id;
				const track = result?.cameras[camera]?.tracks.find((one) => one.id === now);
				const canvas = h("canvas", { "aria-hidden": "true" });
				const there = Boolean(track?.box && track.visible);
				const cell = h(
					"button",
					{
						class: `fr${inside(step) ? " in" : ""}`,
						"--row": row + 2,
						"--column": k + 2,
						"--c": `var(--id-${colourIndex(id)})`,
						"data-at": step,
						"aria-label": `${id} at step ${step} by ${name}${there ? "" : track ? ", out of view" : ", not there"}`,
						onclick: () => playback.seek(step),
					},
					canvas,
					!there && h("span.small", track ? "out of view" : "not there"),
				);
				cells.push({ canvas, cell, step, box: there ? (track?.box ?? null) : null, id });
				return cell;
			}),
		]);
		fill(
			film,
			...steps.map((step, k) =>
				h(
					"span",
					{ class: `fs${inside(step) ? " in" : ""}`, "--column": k + 2, "data-at": step },
					step,
				),
			),
			...rows,
		);
		film.style.setProperty("--rows", String(ids.length));
		mark();
		await Promise.all(
			cells.map(async ({ canvas, cell, step, box, id }) => {
				if (!box) return;
				const bitmap = await crops.pictureOf(camera, step);
				if (turn !== drawn) return;
				drawCrop(canvas, bitmap, box, palette().id(id));
				if (!bitmap && views[camera].has_pictures) cell.append(h("span.small", `no frame ${step}`));
			}),
		);
	}

	/** The cameras by their number, those that see them best first in words. @param {number[]} best @param {number} now */
	function numbers(best, now) {
		const views = store.get().cameras;
		cameras.hidden = views.length < 2;
		const rank = (/** @type {number} */ camera) =>
			camera === best[0] ? ", which sees them best" : camera === best[1] ? ", second best" : "";
		const words = views.map(
			({ name }, camera) =>
				/** @type {const} */ ([camera, `C${camera + 1}`, `${name}${rank(camera)}`]),
		);
		fill(
			cameras,
			segment(words, now, (camera) => {
				by = camera;
				void roll();
			}),
		);
	}

	/** The shown step, or the nearest of the film. */
	function mark() {
		const { shown } = store.get();
		const near = steps.reduce(
			(best, step) => (Math.abs(step - shown) < Math.abs(best - shown) ? step : best),
			steps[0] ?? 0,
		);
		for (const part of all("[data-at]", film))
			part.classList.toggle("now", Number(part.dataset.at) === near);
	}

	state.watch(["chosen", "queue", "other", "ends", "placing"], heads);
	state.on(["chosen"], () => (by = null));
	state.on(["chosen", "preview"], () => void roll());
	store.on(["basis", "revision", "place", "theme"], () => void roll());
	store.on(["shown"], mark);
	store.on(["scores"], words);
	/** A wider pane has larger pictures. @type {Timer} */
	let waiting;
	new ResizeObserver(() => {
		clearTimeout(waiting);
		waiting = setTimeout(() => (heads(), void roll()), 120);
	}).observe(film);
}
