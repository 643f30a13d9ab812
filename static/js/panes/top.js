// @ts-check
/** The top bar: what is open, which methods run, how far they are. */
import { chooser, fill, h, icon, tipOf, write } from "../dom.js";

/** @param {HTMLElement} root @param {Context} context */
export function mountTop(root, { store, page, actions }) {
	const sequence = chooser({ label: "Sequence", box: true, choose: page.open });
	const facts = h("span", { class: "sub opt-1" });
	const single = chooser({ label: "Single-view method", word: "single view", choose: (v) => page.change({ single_view: v }) });
	const fusion = chooser({ label: "Fusion method", word: "fusion", choose: (v) => page.change({ fusion_method: v }) });
	const dot = h("span", { class: "dot" });
	const word = h("span", {});
	const bar = h("span", { class: "bar opt-2", role: "progressbar", "aria-label": "Progress", "aria-valuemin": 0 }, h("i", {}));
	const number = h("span", { class: "n" });
	const rate = h("span", { class: "sub t opt-1" });
	const cancel = h("button", { class: "btn", onclick: page.cancel, "data-tip": "Stop; what is computed stays" }, "Cancel");
	const again = h("button", { class: "btn", onclick: page.runAgain, "data-tip": "Compute the steps that are missing" }, "Go on");
	const spoken = h("span", { class: "vh", role: "status" });
	const csv = h(
		"button",
		{ class: "btn", ...tipOf("export"), onclick: actions.exportTracks },
		icon("i-export"),
		h("span", { class: "opt-1" }, "Export CSV"),
	);
	root.append(
		h("h1", { class: "brand" }, icon("i-mark"), "multiview-phd"),
		sequence.root,
		facts,
		h("span", { class: "rule" }),
		single.root,
		fusion.root,
		h("span", { class: "rule" }),
		h("div", { class: "status" }, dot, word, bar, number, rate, cancel, again),
		spoken,
		h("span", { class: "grow" }),
		h(
			"span",
			{ class: "group" },
			csv,
			h("button", { class: "btn icon end", "aria-label": "Dark or light", ...tipOf("theme"), onclick: actions.toggleTheme }, icon("i-theme")),
			h("button", { class: "btn icon end", "aria-label": "Help and keys", ...tipOf("help"), onclick: actions.help }, icon("i-help")),
		),
	);

	function choices() {
		const { server, sequences, schema, link } = store.get();
		const open = server?.opening?.name ?? server?.sequence?.name ?? "";
		const option = (/** @type {SequenceEntry} */ entry) => {
			const size = entry.cameras && entry.frames ? `${entry.cameras} cameras, ${entry.frames} steps` : entry.kind;
			const count = entry.error ? "cannot be read" : size;
			const wait = entry.kind === "rendered" && !entry.ready ? ", rendered on first use" : "";
			// The chosen one stands in the bar, where its name is enough.
			const text = entry.name === open ? entry.name : `${entry.name}  ·  ${count}${wait}`;
			return h("option", { value: entry.name, title: entry.error ?? entry.description }, text);
		};
		const groups = [
			["Rendered rooms", sequences.filter((s) => s.kind === "rendered")],
			["Folders", sequences.filter((s) => s.kind !== "rendered")],
		];
		const unknown = open && !sequences.some((s) => s.name === open);
		fill(
			sequence.select,
			!open && h("option", { value: "", disabled: true }, "choose a sequence"),
			unknown && h("option", { value: open }, open),
			groups.flatMap(([label, entries]) => {
				const list = /** @type {SequenceEntry[]} */ (entries);
				return list.length ? [h("optgroup", { label }, list.map(option))] : [];
			}),
		);
		sequence.select.value = open;
		const size = server?.sequence;
		write(facts, size ? `${size.cameras.length} cameras · ${size.fps} Hz` : "");
		for (const [choice, key] of /** @type {const} */ ([[single, "single_view"], [fusion, "fusion_method"]])) {
			const now = server?.methods[key] ?? "";
			const names = schema?.methods[key] ?? [];
			fill(choice.select, (names.includes(now) ? names : [now, ...names]).map((name) => h("option", { value: name }, name)));
			choice.select.value = now;
			choice.select.disabled = link !== "open" || !server?.sequence;
		}
		sequence.select.disabled = link !== "open" || sequences.length === 0;
		csv.toggleAttribute("disabled", link !== "open" || !(store.get().run?.done ?? 0));
	}

	function status() {
		const { server, run, link } = store.get();
		const opening = server?.opening;
		const say = (/** @type {string} */ kind, /** @type {string} */ text) => {
			dot.className = `dot ${kind}`;
			write(word, text);
			write(spoken, text);
		};
		const busy = Boolean(opening) || run?.state === "computing";
		bar.hidden = link === "lost" || !busy;
		cancel.hidden = link !== "open" || run?.state !== "computing" || Boolean(opening);
		again.hidden = link !== "open" || run?.state !== "cancelled" || Boolean(opening);
		number.hidden = rate.hidden = link === "lost" || (!opening && !run?.total);
		if (link === "lost") say("bad", "not connected");
		else if (!server) say("", "connecting");
		else if (opening) {
			say("busy", "opening");
			progress(opening.done, opening.total);
			write(rate, opening.message);
		} else if (!server.sequence) say("", "nothing open");
		else if (run) {
			const [kind, text] = runWords(run);
			say(kind, text);
			progress(run.done, run.total);
			write(rate, rateText(run));
		}
	}

	/** @param {number} done @param {number} total */
	function progress(done, total) {
		bar.style.setProperty("--part", String(total > 0 ? done / total : 0));
		bar.setAttribute("aria-valuemax", String(total));
		bar.setAttribute("aria-valuenow", String(done));
		fill(number, total > 0 && [h("b", {}, done), `/${total}`]);
	}

	store.on(["server", "sequences", "schema", "link"], choices);
	store.on(["run"], () => csv.toggleAttribute("disabled", store.get().link !== "open" || !(store.get().run?.done ?? 0)));
	store.on(["server", "run", "link"], status);
	choices();
	status();
}

/**
 * @param {RunState} run
 * @returns {[string, string]} sign and word
 */
export function runWords(run) {
	switch (run.state) {
		case "computing":
			return ["busy", "computing"];
		case "done":
			return ["good", "computed"];
		case "failed":
			return ["bad", "failed"];
		case "cancelled":
			return ["warn", "partial"];
		default:
			return ["", "ready"];
	}
}

/**
 * @param {RunState} run
 * @returns {string} speed, and the time left while there is some
 */
export function rateText({ state, steps_per_second: speed, seconds_left: left }) {
	if (!speed) return "";
	const rate = `${speed < 10 ? speed.toFixed(1) : Math.round(speed)} steps/s`;
	if (state !== "computing" || left === null) return rate;
	const time = left < 60 ? `${left.toFixed(left < 10 ? 1 : 0)} s` : `${Math.floor(left / 60)} min ${Math.round(left % 60)} s`;
	return `${rate} · ${time} left`;
}
