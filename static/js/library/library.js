/** The place Library: recordings, the runs of one, and one run in small. */
import { fill, h, icon, one } from "../elements/dom.js";
import { getJson, request } from "../state/api.js";
import { exportMenu } from "./exports.js";
import { lostRecording } from "./lost.js";
import { runsTable } from "./runs.js";
import { factsOf, has, many, size, titleOf, when } from "./words.js";

/** A run that has just ended is kept a moment later. */
const KEPT_MS = 1500;

/** @type {Pane} */
export function mountLibrary(root, { store, actions }) {
	/** @type {Server.LibraryInfo | null} */
	let library = null;
	/** @type {Server.RecordingInfo | null} whose runs are listed */
	let recording = null;
	/** @type {Server.KeptRunInfo[]} */
	let runs = [];
	/** @type {Set<number>} */
	const chosen = new Set();
	/** @type {number | null} */
	let focused = null;
	/** @type {number | null} whose preview is there */
	let drawn = null;
	/** @type {Server.Deleted | null} */
	let deleted = null;
	let starred = false;

	const find = h("input", {
		type: "search",
		placeholder: "find a recording, run or note",
		"aria-label": "Find",
		oninput: () => show(),
	});
	const list = h("div", { class: "scroll list", role: "listbox", "aria-label": "Recordings" });
	const foot = h("div", { class: "foot" });
	const title = h("h2", { class: "pane-title" }, "Runs");
	const sub = h("span", { class: "sub" });
	const only = h(
		"button",
		{ class: "btn", "aria-pressed": "false", onclick: () => ((starred = !starred), show()) },
		icon("i-star", "s"),
		"starred",
	);
	const table = runsTable({
		focus: (run) => void focus(run.id),
		open: (run) => void open(run),
		star: (run) => void change(run, { star: !run.star }),
		tick: (run) => tick(run.id),
	});
	const empty = h("div", { class: "blank", hidden: true });
	const gone = lostRecording({
		moved: (told) => {
			recording = told;
			void refresh();
		},
		actions,
	});
	const picked = h("b");
	const line = h("span", { role: "status", class: "gone-line" });
	const stop = h("button", { class: "btn" }, "Stop");
	const undo = h("button", { class: "btn", "data-key": "Ctrl Z", onclick: takeBack }, "Undo");
	const side = h(
		"button",
		{ class: "btn box", onclick: () => void compare() },
		icon("i-swap"),
		"Compare",
	);
	/** @param {string} words @param {() => void} [cancel] */
	const say = (words, cancel) => {
		fill(line, words);
		undo.hidden = true;
		stop.hidden = !cancel;
		stop.onclick = cancel ?? null;
		bar.hidden = !words && !chosen.size;
	};
	const tools = h(
		"span",
		{ class: "picked", role: "toolbar", "aria-label": "Chosen runs" },
		picked,
		side,
		exportMenu({ actions, say, chosen: () => ofChosen().map(({ id }) => id) }),
		h("button", { class: "btn box", onclick: () => void remove() }, icon("i-trash"), "Delete"),
		h(
			"button",
			{ class: "btn icon", "aria-label": "Choose none", onclick: () => (chosen.clear(), show()) },
			icon("i-close", "s"),
		),
	);
	const bar = h(
		"div",
		{ class: "undo-line" },
		tools,
		h("span", { class: "grow" }),
		line,
		stop,
		undo,
	);
	const small = h("section", { class: "pane pv", "aria-label": "The run" });
	const head = h("div", { class: "pane-head" });
	const body = h("div", { class: "pv-body" });
	small.append(head, body);
	body.addEventListener("change", ({ target }) => {
		const run = focusedRun();
		if (run) void change(run, { note: /** @type {HTMLInputElement} */ (target).value });
	});
	fill(
		root,
		h(
			"section",
			{ class: "pane", "aria-label": "Recordings" },
			h(
				"div",
				{ class: "pane-head" },
				h("h2", { class: "pane-title" }, "Recordings"),
				h("span", { class: "grow" }),
			),
			h("div", { class: "lib-find" }, icon("i-search", "s"), find),
			list,
			foot,
		),
		h(
			"section",
			{ class: "pane runs", "aria-label": "Runs" },
			h(
				"div",
				{ class: "pane-head" },
				title,
				sub,
				h("span", { class: "grow" }),
				only,
				table.chooser,
			),
			gone.element,
			table.element,
			empty,
			bar,
		),
		small,
	);

	const focusedRun = () => runs.find(({ id }) => id === focused);
	const ofChosen = () => runs.filter(({ id }) => chosen.has(id));

	/** Its own, once it was opened; else one of the list of what can be opened, if it has any. */
	/** @param {Server.RecordingInfo} one */
	function picture(one) {
		const kept = one.id !== null;
		if (one.missing || (kept && !one.has_thumbnail)) return icon("i-folder");
		const src = kept
			? `/api/library/thumbnail/${one.id}.jpg`
			: `/api/recordings/picture?name=${encodeURIComponent(one.name)}`;
		const image = h("img", { src, alt: "", loading: "lazy" });
		image.onerror = () => image.replaceWith(icon("i-folder"));
		return image;
	}

	/** @param {Server.RecordingInfo} one */
	function item(one) {
		const on = one.place === recording?.place;
		return h(
			"button",
			{
				class: `item${one.missing ? " bad" : ""}`,
				role: "option",
				"aria-selected": String(on),
				tabindex: on ? 0 : -1,
				title: one.place,
				onclick: () => void choose(one),
				ondblclick: () => openRecording(one),
			},
			h("span", { class: "th" }, picture(one)),
			h(
				"span",
				{ class: "tx" },
				h("b", {}, one.name),
				h("span", { class: `small${one.missing ? " missing" : ""}` }, factsOf(one)),
			),
			h(
				"span",
				{ class: "en" },
				h("b", {}, one.runs || ""),
				h("span", { class: "small" }, one.opened ? when(one.opened) : ""),
			),
		);
	}

	/** Those that are neither of another name nor without a star, where that is asked for. */
	function listed() {
		const text = find.value.trim();
		return runs.filter(
			(run) =>
				(!starred || run.star) &&
				(!text ||
					has(text, [recording?.name ?? "", titleOf(run), run.note, ...run.tags, run.single_view])),
		);
	}

	function show() {
		if (!library) return;
		const text = find.value.trim();
		const matching = listed();
		const kinds = /** @type {const} */ ([
			["Own", "folder"],
			["Rendered rooms", "rendered"],
		]);
		const walked = list.contains(document.activeElement);
		fill(
			list,
			kinds.flatMap(([word, kind]) => {
				const found = (library?.recordings ?? []).filter(
					(one) =>
						one.kind === kind &&
						(!text || has(text, [one.name, one.place]) || one.place === recording?.place),
				);
				const head = h("div", { class: "cap" }, h("span", {}, word), h("span", {}, "runs"));
				return found.length ? [head, ...found.map(item)] : [];
			}),
		);
		// The items are new: who walks through them by arrows goes on from the chosen one.
		if (walked)
			/** @type {HTMLElement | null} */ (list.querySelector('[aria-selected="true"]'))?.focus();
		const kept = library.recordings.reduce((sum, one) => sum + one.runs, 0);
		fill(
			foot,
			library.error ??
				`${many(kept, "run")} · ${size(library.bytes)}${library.read_only ? " · read only" : ""}`,
		);
		foot.title = library.file;
		fill(title, recording ? `Runs of ${recording.name}` : "Runs");
		fill(
			sub,
			recording?.people
				? `${runs.length} · truth of ${many(recording.people, "person").replace("persons", "people")}`
				: String(runs.length || ""),
		);
		only.ariaPressed = String(starred);
		table.element.hidden = !matching.length;
		empty.hidden = Boolean(matching.length);
		if (recording)
			fill(
				empty,
				h("h3", {}, runs.length ? "No run matches" : "Nothing kept yet"),
				h("p", {}, library.error ?? "Every run that comes to its end is kept here."),
				h(
					"button",
					{ class: "btn main", onclick: () => recording && openRecording(recording) },
					`Open ${recording.name}`,
				),
			);
		table.show(matching, chosen, focused);
		gone.show(recording);
		fill(picked, `${chosen.size} chosen`);
		tools.hidden = !chosen.size;
		side.disabled = chosen.size < 2 || chosen.size > 4;
		side.title = side.disabled ? "Two to four runs stand side by side" : "";
		undo.hidden = !deleted;
		stop.hidden = true;
		if (deleted)
			fill(
				line,
				icon("i-trash", "s"),
				`${deleted.runs.length === 1 ? `Run ${deleted.runs[0]}` : many(deleted.runs.length, "run")} deleted, ${size(deleted.bytes)}`,
			);
		bar.hidden = !chosen.size && !deleted;
	}

	/** @param {Server.RecordingInfo} one */
	function openRecording(one) {
		void actions.open(one.place);
		location.hash = "#tune";
	}

	async function refresh() {
		library = /** @type {Server.LibraryInfo} */ (await getJson("/api/library"));
		const { sequence } = store.get();
		const same = (/** @type {Server.RecordingInfo} */ one) =>
			[one.place, one.name].includes(recording?.place ?? sequence?.opened_as ?? "");
		const found = library.recordings.find(same) ?? library.recordings[0] ?? null;
		await choose(found, true);
	}

	/** @param {Server.RecordingInfo | null} one @param {boolean} [again] keep what is chosen */
	async function choose(one, again = false) {
		if (!again) chosen.clear();
		recording = one;
		const found =
			one && one.id !== null ? (await getJson(`/api/library/recordings/${one.id}/runs`)).runs : [];
		// Another one was chosen meanwhile.
		if (recording !== one) return;
		runs = found;
		for (const id of chosen) if (!runs.some((run) => run.id === id)) chosen.delete(id);
		const there = runs.some(({ id }) => id === focused);
		await focus(there && again ? focused : (runs[0]?.id ?? null));
		if (!again) list.querySelector('[aria-selected="true"]')?.scrollIntoView({ block: "nearest" });
	}

	/** @param {number | null} id */
	async function focus(id) {
		focused = id;
		show();
		const run = focusedRun();
		if (!run) {
			drawn = null;
			fill(head);
			return fill(body, h("p", { class: "blank" }, "A run that is chosen is shown here in small."));
		}
		const facts = [when(run.began), many(run.targets, "track")];
		if (run.seconds) facts.push(`computed in ${run.seconds.toFixed(run.seconds < 9.5 ? 1 : 0)} s`);
		fill(
			head,
			h("h2", { class: "pane-title" }, titleOf(run)),
			h("span", { class: "sub" }, facts.join(" · ")),
			h("span", { class: "grow" }),
			h("button", { class: "btn main", onclick: () => void open(run) }, "Open in Tune"),
			h("button", { class: "btn box", onclick: () => void pin(run) }, "Pin as A"),
		);
		const answer = await request(`/api/library/runs/${id}/drawn`).catch((error) => error);
		const text = answer instanceof Error ? "" : await answer.text();
		if (id !== focused) return;
		// Whoever writes a note is not disturbed.
		if (id === drawn && body.contains(document.activeElement)) return;
		drawn = text ? id : null;
		if (text) body.innerHTML = text;
		else fill(body, h("p", { class: "blank" }, answer.message));
	}

	async function compare() {
		const dialog = /** @type {any} */ (one(".compare"));
		const numbers = ofChosen().map(({ id }) => `runs=${id}`);
		const answer = await request(`/api/library/compared?${numbers.join("&")}`).catch(
			(error) => error,
		);
		if (answer instanceof Error)
			return actions.note("error", "The runs cannot be compared", answer.message);
		dialog.innerHTML = await answer.text();
		dialog.onclick = () => dialog.close();
		dialog.showModal();
	}

	/** @param {number} id */
	function tick(id) {
		if (!chosen.delete(id)) chosen.add(id);
		deleted = null;
		show();
	}

	/** @param {Server.KeptRunInfo} run @param {object} what */
	async function change(run, what) {
		const told = await actions.ask("PATCH", `library/runs/${run.id}`, what);
		if (!told) return;
		runs = runs.map((one) => (one.id === run.id ? told : one));
		await focus(focused);
	}

	async function remove() {
		const ids = chosen.size ? [...chosen] : focused === null ? [] : [focused];
		if (!ids.length) return;
		deleted = await actions.ask("POST", "library/delete", { runs: ids });
		chosen.clear();
		await refresh();
	}

	async function takeBack() {
		if (!deleted) return;
		if (await actions.ask("POST", "library/take-back", { runs: deleted.runs })) deleted = null;
		await refresh();
	}

	/** @param {Server.KeptRunInfo} run */
	async function open(run) {
		const state = await actions.ask("POST", `library/runs/${run.id}/open`);
		if (!state) return;
		location.hash = "#tune";
		const older = state.run.stands_for;
		actions.note(
			older ? "warn" : "info",
			`${titleOf(run)} is shown as it was`,
			older
				? "Another version of the program, or another state of the recording, made it."
				: "Its tracks were kept; what the cameras found comes back by computing again.",
			{ word: "Compute again", act: actions.runAgain },
		);
	}

	/** @param {Server.KeptRunInfo} run */
	async function pin(run) {
		if (await actions.ask("POST", `library/runs/${run.id}/pin`))
			actions.note("info", `${titleOf(run)} is run A now`, "Tune sets the shown run against it.");
	}

	/** Have a name written in the run's row. */
	function rename() {
		const run = focusedRun();
		const cell = root.querySelector(`tr[data-run="${focused}"] td:nth-child(2)`);
		if (!run || !cell) return;
		const field = h("input", { class: "field", value: run.name, "aria-label": "Name of the run" });
		let over = false;
		const end = (/** @type {boolean} */ keep) => {
			if (over) return;
			over = true;
			if (keep && field.value !== run.name) void change(run, { name: field.value });
			else show();
		};
		field.addEventListener("keydown", (event) => {
			event.stopPropagation();
			if (event.key === "Enter" || event.key === "Escape") end(event.key === "Enter");
		});
		field.addEventListener("blur", () => end(true));
		fill(cell, field);
		field.select();
	}

	/** What a key does here. @type {Record<string, () => void>} */
	const KEYS = {
		Enter: () => {
			const run = focusedRun();
			if (run) void open(run);
		},
		" ": () => focused !== null && tick(focused),
		s: () => {
			const run = focusedRun();
			if (run) void change(run, { star: !run.star });
		},
		F2: rename,
		Delete: () => void remove(),
		"Ctrl+a": () => (listed().forEach(({ id }) => chosen.add(id)), show()),
		"Ctrl+z": () => void takeBack(),
		"/": () => find.focus(),
	};
	document.addEventListener(
		"keydown",
		(event) => {
			if (store.get().place !== "library" || document.querySelector("dialog[open]")) return;
			const target = /** @type {HTMLElement} */ (event.target);
			const types = target.matches("input:not([type=checkbox])");
			if (event.key === "Escape" && !target.closest("[popover]")) {
				if (types) target.blur();
				else if (chosen.size) (chosen.clear(), show());
				else location.hash = "#tune";
				return event.stopPropagation();
			}
			const control = event.ctrlKey || event.metaKey;
			if (types || event.altKey) return;
			if (target.closest(".list") && ["ArrowDown", "ArrowUp"].includes(event.key)) {
				const items = [...list.querySelectorAll("button")];
				const next =
					items[items.indexOf(/** @type {any} */ (target)) + (event.key === "ArrowDown" ? 1 : -1)];
				next?.focus();
				next?.click();
				return stopped(event);
			}
			const act = KEYS[(control ? "Ctrl+" : "") + (control ? event.key.toLowerCase() : event.key)];
			const onButton = target.closest("button, a, input");
			if (!act || (onButton && ["Enter", " "].includes(event.key))) return;
			act();
			stopped(event);
		},
		true,
	);
	/** @param {Event} event */
	function stopped(event) {
		event.preventDefault();
		event.stopPropagation();
	}
	root.addEventListener("focusin", ({ target }) => {
		const id = Number(/** @type {HTMLElement} */ (target).closest("tr")?.dataset.run);
		if (id && id !== focused) void focus(id);
	});

	/** @type {Timer} */
	let waiting;
	store.watch(["place", "run"], ({ place, run }) => {
		if (place !== "library") return;
		clearTimeout(waiting);
		if (!library) return void refresh();
		if (run?.state === "done" || run?.state === "idle")
			waiting = setTimeout(() => void refresh(), KEPT_MS);
	});
	store.on(["place"], ({ place }) => {
		if (place === "library") void refresh();
	});
	show();
}
