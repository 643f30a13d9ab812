/** The recordings of the library, own and rendered ones, as a list to choose from. */
import { fill, h, icon } from "../elements/dom.js";
import { factsOf, has, many, size, when } from "./words.js";

const KINDS = /** @type {const} */ ([
	["Own", "folder"],
	["Built-in rooms", "rendered"],
]);

/** What recordings are sorted by; as they come they are by when they were opened. */
/** @type {Record<string, (a: Server.RecordingInfo, b: Server.RecordingInfo) => number>} */
const ORDERS = {
	"last opened": () => 0,
	name: (a, b) => a.name.localeCompare(b.name, undefined, { numeric: true }),
	"most runs": (a, b) => b.runs - a.runs,
	longest: (a, b) => b.frames - a.frames,
};

/** Its own, once it was opened; else one of the list of what can be opened, if it has any. */
/** @param {Server.RecordingInfo} one */
function picture(one) {
	const kept = one.id !== null;
	if (one.boxes_only) return icon("i-boxes", "l");
	if (one.missing || (kept && !one.has_thumbnail)) return icon("i-folder");
	const src = kept
		? `/api/library/thumbnail/${one.id}.jpg`
		: `/api/recordings/picture?name=${encodeURIComponent(one.name)}`;
	const image = h("img", { src, alt: "", loading: "lazy" });
	image.onerror = () => image.replaceWith(icon("i-folder"));
	return image;
}

/**
 * @param {object} on
 * @param {(recording: Server.RecordingInfo) => void} on.choose
 * @param {(recording: Server.RecordingInfo) => void} on.open
 * @param {() => void} on.add  another recording is wanted
 * @param {() => void} on.find
 */
export function shelf(on) {
	const find = h("input", {
		type: "search",
		placeholder: "find",
		title: "A recording, a run or a note",
		"aria-label": "Find",
		oninput: () => on.find(),
	});
	const order = h(
		"select",
		{ "aria-label": "Sort recordings by", onchange: () => on.find() },
		Object.keys(ORDERS).map((word) => h("option", {}, word)),
	);
	const list = h("div", { class: "scroll list", role: "listbox", "aria-label": "Recordings" });
	const foot = h("div", { class: "foot" });
	const element = h(
		"section",
		{ class: "pane", "aria-label": "Recordings" },
		h(
			"div",
			{ class: "pane-head" },
			h("h2", { class: "pane-title" }, "Recordings"),
			h("span", { class: "grow" }),
			h("button", { class: "btn", "data-key": "Ctrl O", onclick: on.add }, "Open…"),
		),
		h("div", { class: "lib-find" }, icon("i-search", "s"), find, order),
		list,
		foot,
	);

	/** @param {Server.RecordingInfo} one @param {boolean} chosen */
	const item = (one, chosen) =>
		h(
			"button",
			{
				class: `item${one.missing ? " bad" : ""}`,
				role: "option",
				"aria-selected": String(chosen),
				tabindex: chosen ? 0 : -1,
				title: one.place,
				onclick: () => on.choose(one),
				ondblclick: () => on.open(one),
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

	return {
		element,
		/** Where somebody writes what is sought. */
		find,
		/** What is sought. */
		text: () => find.value.trim(),
		reveal: () =>
			list.querySelector('[aria-selected="true"]')?.scrollIntoView({ block: "nearest" }),
		/**
		 * From one to the next by an arrow; whether the key was one of the list's.
		 * @param {KeyboardEvent} event
		 */
		walk({ key, target }) {
			const from = /** @type {HTMLElement} */ (target);
			if (!list.contains(from) || !["ArrowDown", "ArrowUp"].includes(key)) return false;
			const items = [...list.querySelectorAll("button")];
			const next = items[items.indexOf(/** @type {any} */ (from)) + (key === "ArrowDown" ? 1 : -1)];
			next?.focus();
			next?.click();
			return true;
		},
		/**
		 * @param {Server.LibraryInfo} library
		 * @param {Server.RecordingInfo | null} recording  whose runs are listed
		 */
		show(library, recording) {
			const text = this.text();
			const walked = list.contains(document.activeElement);
			fill(
				list,
				KINDS.flatMap(([word, kind]) => {
					const found = library.recordings
						.toSorted(ORDERS[order.value] ?? (() => 0))
						.filter(
							(one) =>
								one.kind === kind &&
								(!text || has(text, [one.name, one.place]) || one.place === recording?.place),
						);
					const head = h("div", { class: "cap" }, h("span", {}, word), h("span", {}, "runs"));
					const items = found.map((one) => item(one, one.place === recording?.place));
					return found.length ? [head, ...items] : [];
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
		},
	};
}
