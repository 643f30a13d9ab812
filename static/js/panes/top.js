/** The top bar: its places, what is open, which methods run, how far they are. */
import { allow, fill, h, one, parts, rate, write, all, refill } from "../elements/dom.js";
import { PLACES, isBench, placeOf } from "../state/address.js";
import { isOld } from "../state/events.js";

/* ---------- The words of the top bar that lead from place to place, and what they lead to. A
   part of the page belongs to a place by its `data-place`; `bench` stands for all that are the
   workbench. */

/** The place that the page was opened at. */
export const OPENED_AT = placeOf(location.hash);

/** @type {Pane} */
export function mountPlaces(root, context) {
	const { store, actions } = context;
	/** Places whose module is being read, or is there. @type {Set<string>} */
	const known = new Set();
	const links = PLACES.map(({ name, word, tip }) =>
		h(
			"a.place",
			{ href: `#${name}`, "data-tip": tip, "data-go": name },
			word,
			h("span.count", { hidden: true }),
		),
	);
	fill(root, links);
	const follow = () => store.set({ place: placeOf(location.hash) });
	addEventListener("hashchange", follow);
	follow();

	/** @param {PageSite} site */
	async function fillIn({ name, word, read }) {
		if (!read || known.has(name)) return;
		known.add(name);
		const part = one(`[data-place="${name}"]`);
		try {
			(await read())(part, context);
		} catch (error) {
			known.delete(name);
			actions.note("error", `${word} could not be read`, `${error}`, {
				word: "Try again",
				act: () => location.reload(),
			});
		}
	}

	for (const { name, word, read } of PLACES)
		if (read && !one(`[data-place="${name}"]`))
			one(".app").append(
				h("section", {
					class: `place-${name}`,
					"aria-label": word,
					"data-place": name,
					hidden: true,
				}),
			);
	store.watch(["place"], ({ place }) => {
		PLACES.forEach((site, k) => {
			links[k].ariaCurrent = site.name === place ? "page" : null;
			if (site.name === place) void fillIn(site);
		});
		one(".app").classList.toggle("away", !isBench(place));
		one(".app").dataset.at = place;
		for (const part of all("[data-place]"))
			part.hidden =
				part.dataset.place !== (part.dataset.place === "bench" && isBench(place) ? "bench" : place);
		dispatchEvent(new Event("panes"));
	});
	store.watch(["place", "server", "run", "timeline", "signs"], (state) =>
		PLACES.forEach(({ name, exists, sign }, k) => {
			// Who is there by the address stays there.
			links[k].hidden = Boolean(exists && !exists(state) && state.place !== name);
			const count = /** @type {HTMLElement} */ (links[k].lastChild);
			write(count, sign?.(state) ?? state.signs[name] ?? "");
			count.hidden = !count.textContent;
		}),
	);
}

/** @type {Pane} */
export function mountTop(root, { store, actions }) {
	const {
		sequence,
		facts,
		single_view,
		fusion_method,
		smoothing_method,
		dot,
		word,
		bar,
		number,
		left,
		rate,
		cancel,
		again,
		spoken,
		leave,
	} = parts(root);
	const methods = { single_view, fusion_method, smoothing_method };
	sequence.addEventListener("change", () => actions.open(sequence.value));
	for (const [key, select] of Object.entries(methods))
		select.addEventListener("change", () => actions.change({ [key]: select.value }));
	// A chosen word leaves the focus to the page, so that Space goes on meaning play.
	for (const select of [sequence, ...Object.values(methods)])
		select.addEventListener("change", () => select.blur());

	leave.onclick = () => actions.exportForms();

	function lists() {
		const { server, sequences, schema, link } = store.get();
		const recording = server?.sequence;
		// What is shown, until another is there in its place.
		const open = recording?.name ?? server?.opening?.name ?? "";
		// Its own name need not be that of its folder.
		const shown = sequences.find(({ name, folder }) =>
			recording ? folder === recording.folder : name === open,
		);
		const option = (/** @type {Server.SequenceEntryInfo} */ entry) => {
			const { name, description, cameras, frames, kind, error } = entry;
			const size = error
				? "cannot be read"
				: frames
					? `${cameras} camera${cameras === 1 ? "" : "s"}, ${frames} steps`
					: kind;
			return h(
				"option",
				{ value: name, title: error ?? description },
				entry === shown ? open : `${name}  ·  ${size}`,
			);
		};
		/** @param {string} label @param {string} kind */
		const group = (label, kind) => {
			const entries = sequences.filter((one) => one.kind === kind);
			return entries.length > 0 && h("optgroup", { label }, entries.map(option));
		};
		refill(
			sequence,
			!shown && h("option", { value: open, disabled: !open }, open || "choose a sequence"),
			group("Built-in rooms", "rendered"),
			group("Folders", "folder"),
		);
		sequence.value = shown?.name ?? open;
		sequence.disabled = link !== "open" || !sequences.length;
		write(facts, recording ? `${recording.cameras.length} cameras · ${recording.fps} Hz` : "");
		for (const [key, select] of Object.entries(methods)) {
			const now = server?.parameters[key] ?? "";
			const names = schema?.methods[key] ?? [];
			const unfit = server?.unfit[key] ?? {};
			refill(
				select,
				(names.includes(now) ? names : [now, ...names]).map((name) =>
					h(
						"option",
						{ value: name, title: unfit[name] },
						unfit[name] ? `${name} · not here` : name,
					),
				),
			);
			select.title = unfit[now] ?? "";
			select.value = now;
			select.disabled = link !== "open" || !recording;
		}
	}

	function status() {
		const { server, run, link } = store.get();
		const opening = server?.opening;
		const say = (/** @type {string} */ kind, /** @type {string} */ text) => {
			dot.className = `dot ${kind}`;
			write(word, text);
			write(spoken, text);
		};
		allow(leave, link === "open" && run?.done ? "" : "There are no tracks yet.");
		bar.hidden = link === "lost" || !(opening || run?.state === "computing");
		cancel.hidden = link !== "open" || run?.state !== "computing" || Boolean(opening);
		again.hidden = link !== "open" || run?.state !== "cancelled" || Boolean(opening);
		left.hidden = rate.hidden = link === "lost" || !(opening || run?.total);
		const [kind, text] =
			link === "lost"
				? ["bad", "not connected"]
				: !server
					? ["", "connecting"]
					: opening
						? ["busy", server.sequence ? `opening ${opening.name}` : "opening"]
						: server.sequence && run
							? WORDS[run.state]
							: ["", "nothing open"];
		say(kind, text);
		const { done, total } = (!opening && run) || { done: 0, total: 0 };
		// After its last step a run is smoothed, and nobody knows how long that takes.
		const endless = Boolean(opening) || (total > 0 && done === total);
		bar.classList.toggle("endless", endless);
		bar.style.setProperty("--part", String(total > 0 ? done / total : 0));
		bar.ariaValueMax = String(total);
		bar.ariaValueNow = endless ? null : String(done);
		// Then its steps are no measure of how far it is.
		number.hidden = left.hidden || (endless && run?.state === "computing");
		fill(number, total > 0 && [h("b", done), `/${total}`]);
		const time = run ? timeText(run) : "";
		const words = opening ? "reading" : time || run?.message || "";
		write(left, words);
		// Words may be cut, a time may not.
		left.classList.toggle("words", !time);
		if (time || !words) delete left.dataset.tip;
		else left.dataset.tip = words;
		write(rate, !opening && run ? rateText(run) : "");
	}

	store.watch(["server", "sequences", "schema", "link"], lists);
	store.watch(["server", "run", "link"], status);
	store.watch(["run", "timeline", "result", "scores"], (state) => {
		for (const [drawn, of] of DRAWN)
			for (const part of all(drawn)) part.classList.toggle("old", isOld(state, of(state)));
	});
	// What stands there is of what was open before, and goes.
	store.watch(["server"], ({ server }) =>
		one(".app").classList.toggle("leaving", Boolean(server?.opening && server.sequence)),
	);
}

/**
 * What is drawn from a run, and from which: it stays, marked, until the new one has the same. Of the
 * pictures only what lies over them is.
 * @type {[string, (state: Readonly<PageState>) => string | undefined][]}
 */
const DRAWN = [
	[
		".lanes, .plot canvas, #panel-tracks .scroll, #panel-events [data-fill]",
		({ timeline }) => timeline?.run,
	],
	["#panel-step [data-fill]", ({ result }) => result?.run],
	["#panel-compare [data-fill]", ({ scores }) => scores?.series.run],
];

/** @type {Record<Server.RunInfo["state"], [string, string]>} */
const WORDS = {
	computing: ["busy", "computing"],
	done: ["good", "computed"],
	failed: ["bad", "failed"],
	cancelled: ["warn", "partial"],
	idle: ["", "ready"],
};

/** @param {Server.RunInfo} run  @returns {string} the time left, empty where it is unknown */
function timeText({ state, done, total, steps_per_second: speed, seconds_left: left }) {
	if (state !== "computing" || !speed || left === null || done === total) return "";
	return left < 60
		? `${left.toFixed(left < 10 ? 1 : 0)} s left`
		: `${Math.floor(left / 60)} min ${Math.round(left % 60)} s left`;
}

/** @param {Server.RunInfo} run  @returns {string} */
const rateText = ({ steps_per_second: speed }) => (speed ? `${rate(speed)} steps/s` : "");
