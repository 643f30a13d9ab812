/** The queue of doubtful places where the sliders stand, and under it what was put right. */
import { claim, capital, fill, h, icon, idTag, write } from "../elements/dom.js";
import { signButton } from "../elements/drawn.js";
import { commandOf, keyLabel } from "../state/commands.js";
import { shownVersion } from "../state/events.js";
import { offerTurn } from "../panes/controls.js";
import { drawCrop } from "./crops.js";
import { ICONS, camerasFor, clockOf, middleOf, percent, stepsOf, unbroken } from "./words.js";
import { palette } from "../draw/canvas.js";

/** Places that are listed. */
const MOST = 200;

/**
 * @param {HTMLElement} root @param {Context} context @param {Check} check
 * @param {ReturnType<typeof import("./crops.js").createCrops>} crops
 */
export function mountQueue(root, { store, actions }, check, crops) {
	const { state } = check;
	let byTime = false;
	const sub = h("span.sub", { role: "status" });
	const order = h("button.btn", {
		"data-tip": "Order: what is most at stake first, or as they come",
		onclick: () => ((byTime = !byTime), list()),
	});
	const places = h("div.qlist", {
		role: "listbox",
		"aria-label": "Places, most doubtful first",
		tabindex: 0,
	});
	const blank = h("div.blank.qblank", { hidden: true });
	const cameras = h("p.small.keepnote", { hidden: true });
	const count = h("span.count");
	/** @param {"undo" | "redo"} what @param {-1 | 1} direction */
	const turn = (what, direction) =>
		signButton(`i-${what}`, commandOf(what).title, () => actions.undo(direction), {
			"data-key": commandOf(what).keys.map(keyLabel).join(),
		});
	const [undo, redo] = [turn("undo", -1), turn("redo", 1)];
	store.watch(["server"], ({ server }) => {
		offerTurn(undo, "undo", server);
		offerTurn(redo, "redo", server);
	});
	const file = h(
		"button.btn",
		{
			"data-tip": "What is checked, as ground truth for an evaluation",
			onclick: () => actions.correct("truth"),
		},
		icon("i-export", "s"),
		"Save truth",
	);
	const done = h("div.qds", {
		role: "listbox",
		"aria-label": "Corrections, newest first",
		tabindex: 0,
	});
	const told = h("p.small.keepnote");
	fill(
		root,
		h("div.qhead", h("h2.pane-title", "Check"), sub, h("span.grow"), order),
		cameras,
		places,
		blank,
		h("div.qdone", h("h3.h", "Corrections", count, h("span.grow"), file, undo, redo), done, told),
	);

	/** Pictures are read for what is in sight. */
	const sight = new IntersectionObserver(
		(entries) => {
			for (const { isIntersecting, target } of entries)
				if (isIntersecting) {
					sight.unobserve(target);
					void picture(/** @type {HTMLElement} */ (target));
				}
		},
		{ root: places },
	);

	/** @type {Map<string, HTMLElement>} */
	const items = new Map();
	/** What an item is of; its pictures are of a run. @param {Doubt} doubt */
	const keyOf = ({ id, first, last, tracks, doubt }) =>
		`${id} ${first} ${last} ${tracks} ${doubt} ${shownVersion(store.get())}`;

	/** Of the first one before and of the last one after. @param {HTMLElement} item */
	async function picture(item) {
		const doubt = state.get().queue?.doubts.find(({ id }) => id === item.dataset.doubt);
		const canvases = item.querySelectorAll("canvas");
		if (!doubt) return;
		const { tracks, first, last, sights } = doubt;
		if (sights.length) {
			const ends = sights.filter(({ camera }) => camera === sights[0].camera);
			for (const [k, { step, camera, box }] of [ends[0], ends[ends.length - 1]].entries())
				drawCrop(canvases[k], await crops.pictureOf(camera, step), box, palette().id(1));
			return;
		}
		const ends = /** @type {[number, number][]} */ ([
			[tracks[0], first],
			[tracks[tracks.length - 1], last],
		]);
		for (const [k, [id, step]] of ends.entries()) {
			const result = await crops.resultAt(step);
			const [camera] = camerasFor([result], [id], store.get().cameras.length);
			const box = result?.cameras[camera]?.tracks.find((track) => track.id === id)?.box;
			if (!box) continue;
			const bitmap = await crops.pictureOf(camera, step);
			drawCrop(canvases[k], bitmap, box, palette().id(id));
		}
	}

	/** @param {Doubt} doubt */
	function make(doubt) {
		const item = h(
			"div.qi",
			{
				role: "option",
				id: `place-${doubt.id}`,
				"data-doubt": doubt.id,
				onclick: () => check.choose(doubt),
			},
			h("span.qn", { "aria-hidden": "true" }),
			h("span.qp", { "aria-hidden": "true" }, h("canvas"), icon("i-next", "s"), h("canvas")),
			h("span.qt", h("b", doubt.title), h("span.small", stepsOf(doubt.first, doubt.last))),
			h(
				"span.qs",
				h("span.dbar", {
					"--v": doubt.doubt,
					role: "img",
					"aria-label": `doubt ${percent(doubt.doubt)}`,
					title: `${percent(doubt.doubt)} doubtful, ${doubt.stake} steps depend on it`,
				}),
			),
			h("p", { title: doubt.why }, unbroken(doubt.why)),
		);
		sight.observe(item);
		return item;
	}

	/** In the order that they are shown in. */
	function ordered() {
		const doubts = state.get().queue?.doubts.slice(0, MOST) ?? [];
		return byTime ? [...doubts].sort((a, b) => middleOf(a) - middleOf(b)) : doubts;
	}

	function list() {
		const { queue, chosen } = state.get();
		const doubts = ordered();
		const keys = new Set(doubts.map(keyOf));
		for (const [key, item] of items) if (!keys.has(key)) (item.remove(), items.delete(key));
		doubts.forEach((doubt, k) => {
			const item = items.get(keyOf(doubt)) ?? make(doubt);
			items.set(keyOf(doubt), item);
			item.ariaSelected = String(doubt.id === chosen?.id);
			const number = (queue?.doubts.indexOf(doubt) ?? k) + 1;
			write(/** @type {Node} */ (item.firstChild), String(number));
			if (places.children[k] !== item) places.insertBefore(item, places.children[k] ?? null);
		});
		const at = doubts.find(({ id }) => id === chosen?.id);
		places.setAttribute("aria-activedescendant", at ? `place-${at.id}` : "");
		places.ariaLabel = byTime ? "Places, as they come" : "Places, most doubtful first";
		const words = byTime ? "as they come" : "most doubtful";
		order.ariaLabel = `Order: ${words}`;
		fill(order, icon("i-swap", "s"), h("span.opt-1", words));
		head();
	}

	function head() {
		const { queue } = state.get();
		const { run, sequence } = store.get();
		const left = queue?.doubts.length ?? 0;
		const answered = queue?.answered ?? 0;
		const computing = run?.state === "computing";
		write(
			sub,
			!queue
				? computing
					? "computing"
					: ""
				: `${left} left · ${answered} done${computing ? " · computing" : ""}`,
		);
		const words = queue?.cameras ?? [];
		cameras.hidden = !words.length;
		if (words.length)
			fill(
				cameras,
				icon("i-warn", "s"),
				h(
					"span",
					words.map((one) => `${capital(one)}. `),
				),
			);
		places.hidden = left === 0;
		order.hidden = left < 2;
		blank.hidden = left > 0;
		if (left) return;
		if (!queue || (computing && !answered))
			return fill(
				blank,
				h("h3", computing ? "Computing" : sequence ? "No run yet" : "No recording is open"),
				h("p", "Places appear as the run passes them."),
			);
		fill(
			blank,
			h("h3", answered ? `All ${answered} done` : "Nothing to check"),
			h("p", `Judged by ${queue.how}.`),
			answered > 0 &&
				h(
					"button.btn.box",
					{ onclick: () => actions.exportTracks() },
					icon("i-export", "s"),
					"Export the tracks",
				),
		);
	}

	places.addEventListener("keydown", (event) => {
		const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
		const doubts = ordered();
		if (!step || !doubts.length) return;
		const index = doubts.findIndex(({ id }) => id === state.get().chosen?.id);
		check.choose(doubts[Math.max(0, Math.min(doubts.length - 1, index + step))]);
		claim(event);
	});

	/** The correction that is walked to. */
	let at = "";
	/** @param {Told} one */
	function show(one) {
		at = one.id;
		corrected();
		store.set({ playing: 0 });
		actions.go(`${one.first} ${one.tracks[0] ?? store.get().selection ?? 0}`);
	}

	/** @param {Told} one */
	function line(one) {
		const unmet = one.met === false;
		return h(
			"div",
			{
				class: `qd${unmet ? " unmet" : ""}`,
				role: "option",
				id: `correction-${one.id}`,
				"aria-selected": String(one.id === at),
				title: [one.words, one.why, one.note].filter(Boolean).join(". "),
				onclick: () => show(one),
				ondblclick: () => void check.drop(one.id),
			},
			icon(unmet ? "i-warn" : (ICONS[one.kind] ?? "i-pin"), "s"),
			h(
				"span.qw.cut",
				[...new Set(one.tracks)].slice(0, 2).flatMap((id) => [idTag(id), " "]),
				one.words,
				unmet && h("span.q", ` · ${one.why || "found no track"}`),
			),
			h("span.q", one.met === null ? "…" : clockOf(one.time)),
		);
	}

	function corrected() {
		const { told: now } = state.get();
		const newest = [...(now?.corrections ?? [])].reverse();
		if (!newest.some(({ id }) => id === at)) at = newest[0]?.id ?? "";
		write(count, String(newest.length));
		count.hidden = !newest.length;
		file.hidden = !now?.checked.length && !newest.length;
		done.hidden = !newest.length;
		fill(done, newest.map(line));
		done.setAttribute("aria-activedescendant", at ? `correction-${at}` : "");
		const chosen = newest.find(({ id }) => id === at);
		const unmet = newest.filter(({ met }) => met === false).length;
		fill(
			told,
			icon(unmet || now?.problem ? "i-warn" : "i-pin", "s"),
			h(
				"span",
				now?.problem
					? `Left out, and nothing new is taken: ${now.problem}. `
					: unmet
						? `${unmet} ${unmet === 1 ? "does" : "do"} not hold. `
						: newest.length
							? "A run again keeps them: each is tied to a place and a step. "
							: "What you put right stands here, and holds after every change of parameters. ",
			),
			chosen &&
				h(
					"span.group",
					h("button.btn", { onclick: () => show(chosen) }, "Show"),
					h("button.btn", { onclick: () => void check.drop(chosen.id) }, "Drop"),
				),
		);
	}

	done.addEventListener("keydown", (event) => {
		const newest = [...(state.get().told?.corrections ?? [])].reverse();
		const index = newest.findIndex(({ id }) => id === at);
		const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
		if (step && newest.length) show(newest[Math.max(0, Math.min(newest.length - 1, index + step))]);
		else if (event.key === "Enter" && newest[index]) show(newest[index]);
		else if (event.key === "Delete" && newest[index]) void check.drop(newest[index].id);
		else return;
		claim(event);
	});

	state.watch(["queue", "chosen"], list);
	state.on(["chosen"], ({ chosen }) =>
		places.querySelector(`#place-${chosen?.id ?? "none"}`)?.scrollIntoView({ block: "nearest" }),
	);
	state.watch(["told"], () => (corrected(), head()));
	store.on(["run", "sequence"], head);
	store.on(["basis", "revision", "theme"], list);
}
