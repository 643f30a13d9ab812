/** The top bar: what is open, which methods run, how far they are. */
import { fill, h, parts, write } from "../elements/dom.js";

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
		rate,
		cancel,
		again,
		spoken,
		csv,
	} = parts(root);
	const methods = { single_view, fusion_method, smoothing_method };
	sequence.addEventListener("change", () => actions.open(sequence.value));
	for (const [key, select] of Object.entries(methods))
		select.addEventListener("change", () => actions.change({ [key]: select.value }));
	// A chosen word leaves the focus to the page, so that Space goes on meaning play.
	for (const select of [sequence, ...Object.values(methods)])
		select.addEventListener("change", () => select.blur());

	function lists() {
		const { server, sequences, schema, link } = store.get();
		const open = server?.opening?.name ?? server?.sequence?.name ?? "";
		const option = (
			/** @type {Server.SequenceEntryInfo} */ { name, description, cameras, frames, kind, error },
		) => {
			const size = error
				? "cannot be read"
				: cameras && frames
					? `${cameras} cameras, ${frames} steps`
					: kind;
			// The chosen one stands in the bar, where its name is enough.
			return h(
				"option",
				{ value: name, title: error ?? description },
				name === open ? name : `${name}  ·  ${size}`,
			);
		};
		const group = (
			/** @type {string} */ label,
			/** @type {Server.SequenceEntryInfo[]} */ entries,
		) => entries.length > 0 && h("optgroup", { label }, entries.map(option));
		fill(
			sequence,
			!open && h("option", { value: "", disabled: true }, "choose a sequence"),
			open && !sequences.some(({ name }) => name === open) && h("option", { value: open }, open),
			group(
				"Built-in rooms",
				sequences.filter(({ kind }) => kind === "rendered"),
			),
			group(
				"Folders",
				sequences.filter(({ kind }) => kind !== "rendered"),
			),
		);
		sequence.value = open;
		sequence.disabled = link !== "open" || sequences.length === 0;
		const size = server?.sequence;
		write(facts, size ? `${size.cameras.length} cameras · ${size.fps} Hz` : "");
		for (const [key, select] of Object.entries(methods)) {
			const now = server?.parameters[key] ?? "";
			const names = schema?.methods[key] ?? [];
			const unfit = server?.unfit[key] ?? {};
			fill(
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
			select.disabled = link !== "open" || !size;
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
		csv.disabled = link !== "open" || !run?.done;
		bar.hidden = link === "lost" || !(opening || run?.state === "computing");
		cancel.hidden = link !== "open" || run?.state !== "computing" || Boolean(opening);
		again.hidden = link !== "open" || run?.state !== "cancelled" || Boolean(opening);
		number.hidden = rate.hidden = link === "lost" || !(opening || run?.total);
		const [kind, text] =
			link === "lost"
				? ["bad", "not connected"]
				: !server
					? ["", "connecting"]
					: opening
						? ["busy", "opening"]
						: server.sequence && run
							? runWords(run)
							: ["", "nothing open"];
		say(kind, text);
		const { done, total } = (!opening && run) || { done: 0, total: 0 };
		bar.style.setProperty("--part", String(total > 0 ? done / total : 0));
		bar.setAttribute("aria-valuemax", String(total));
		bar.setAttribute("aria-valuenow", String(done));
		fill(number, total > 0 && [h("b", {}, done), `/${total}`]);
		write(rate, opening ? "reading" : run ? rateText(run) : "");
	}

	store.watch(["server", "sequences", "schema", "link"], lists);
	store.watch(["server", "run", "link"], status);
}

/** @type {Record<Server.RunInfo["state"], [string, string]>} */
const WORDS = {
	computing: ["busy", "computing"],
	done: ["good", "computed"],
	failed: ["bad", "failed"],
	cancelled: ["warn", "partial"],
	idle: ["", "ready"],
};

/** @param {Server.RunInfo} run  @returns {[string, string]} sign and word */
export const runWords = ({ state, smoothed }) =>
	state === "done" && smoothed ? ["good", "smoothed"] : WORDS[state];

/** @param {Server.RunInfo} run  @returns {string} speed and time left, or why it does not begin */
export function rateText({ state, message, steps_per_second: speed, seconds_left: left }) {
	if (!speed) return message;
	const rate = `${speed < 10 ? speed.toFixed(1) : Math.round(speed)} steps/s`;
	if (state !== "computing" || left === null) return rate;
	const time =
		left < 60
			? `${left.toFixed(left < 10 ? 1 : 0)} s`
			: `${Math.floor(left / 60)} min ${Math.round(left % 60)} s`;
	return `${rate} · ${time} left`;
}
