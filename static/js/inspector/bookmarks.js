/** Steps that somebody marked, each with a note: kept in this browser for each recording. */
import { all, fill, h, icon } from "../elements/dom.js";

const nameOf = (/** @type {string} */ recording) => `bookmarks ${recording}`;

/** @param {string} recording @returns {Bookmark[]} */
function kept(recording) {
	try {
		return JSON.parse(localStorage.getItem(nameOf(recording)) ?? "[]");
	} catch {
		return [];
	}
}

/** @param {HTMLElement} root @param {Context} context */
export function mountBookmarks(root, { store, actions, playback }) {
	let recording = "";

	/** @param {number} step @param {string | null} note  null: it is taken away */
	function put(step, note) {
		const others = store.get().bookmarks.filter((mark) => mark.step !== step);
		const all = note === null ? others : [...others, { step, note }];
		store.set({ bookmarks: all.sort((a, b) => a.step - b.step) });
	}

	function list() {
		const { bookmarks } = store.get();
		root.hidden = bookmarks.length === 0;
		// A note that was just written stands there already, and a list that is drawn anew takes the
		// button away on which its writer is pressing.
		const notes = all("input", root);
		const same = (/** @type {Bookmark} */ { step, note }, /** @type {number} */ k) =>
			notes[k].id === `note-${step}` && notes[k].value === note;
		if (notes.length === bookmarks.length && bookmarks.every(same)) return;
		const held = document.activeElement?.id;
		fill(
			root,
			bookmarks.map(({ step, note }) =>
				h(
					"li",
					{},
					h(
						"button",
						{
							class: "btn box",
							"aria-label": `Go to step ${step}`,
							onclick: () => playback.seek(step),
						},
						step,
					),
					h("input", {
						id: `note-${step}`,
						"aria-label": `Note of step ${step}`,
						placeholder: "note",
						value: note,
						maxlength: 200,
						onchange: (/** @type {Event} */ { target }) =>
							put(step, /** @type {HTMLInputElement} */ (target).value),
						onkeydown: (/** @type {KeyboardEvent} */ { key, target }) =>
							["Enter", "Escape"].includes(key) && /** @type {HTMLElement} */ (target).blur(),
					}),
					h(
						"button",
						{
							class: "btn icon",
							"aria-label": `Forget step ${step}`,
							onclick: () => put(step, null),
						},
						icon("i-close", "s"),
					),
				),
			),
		);
		if (held?.startsWith("note-")) document.getElementById(held)?.focus();
	}

	store.watch(["sequence"], ({ sequence }) => {
		if (!sequence || sequence.opened_as === recording) return;
		recording = sequence.opened_as;
		store.set({ bookmarks: kept(recording) });
	});
	store.on(["bookmarks"], ({ bookmarks }) => {
		list();
		if (!recording) return;
		try {
			localStorage.setItem(nameOf(recording), JSON.stringify(bookmarks));
		} catch {
			// Without storage they last as long as the page.
		}
	});
	actions.bookmark = () => {
		const { shown, bookmarks } = store.get();
		actions.showTab("events");
		if (shown >= 0 && !bookmarks.some(({ step }) => step === shown)) put(shown, "");
		list();
		// Once the panel is there.
		requestAnimationFrame(() => document.getElementById(`note-${shown}`)?.focus());
	};
	list();
}
