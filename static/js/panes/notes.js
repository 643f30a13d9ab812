/** What the page says by itself: notes that lie over it. */
import { fill, h, icon } from "../elements/dom.js";

/** Notes that are seen at once; the others wait behind a line that counts them. */
const MOST = 3;

/** How long a note stands that only tells what was done, milliseconds. */
const STANDS_MS = 6000;

/** @type {Pane} */
export function mountNotes(root, { store, actions, retry }) {
	let dismissed = "";
	let heard = "";
	/** Whose notes stand there, and what they say. */
	let standing = "";
	/** @type {Timer} */
	let ticking;
	/** Notes that go by themselves. @type {Set<number>} */
	const going = new Set();

	/** A note that is read or about to be pressed stays. @param {number} id */
	function expire(id) {
		if (root.matches(":hover, :focus-within")) return void setTimeout(expire, 1000, id);
		going.delete(id);
		remove([id]);
	}

	/** @param {number[]} ids */
	const remove = (ids) =>
		store.set({ notes: store.get().notes.filter(({ id }) => !ids.includes(id)) });

	/** @type {(kind: string, title: string, text: string, buttons: (Node | null)[]) => HTMLElement} */
	const note = (kind, title, text, buttons) =>
		h(
			"div.note",
			{ role: kind === "bad" ? "alert" : null },
			h("span", { class: `dot ${kind}` }),
			h("h2", title),
			h("span.group", buttons),
			text && h("p", text),
		);
	/** A sentence begins with a capital, unless it begins with a name of its own. @param {string} text */
	const sentence = (text) => text.replace(/^[a-z](?=[a-z]* )/, (letter) => letter.toUpperCase());
	const button = (/** @type {string} */ word, /** @type {() => void} */ onclick) =>
		h("button.btn.box", { onclick }, word);
	const close = (/** @type {() => void} */ onclick) =>
		h(
			"button.btn.icon",
			{ "aria-label": "Dismiss", "data-tip": "Dismiss", onclick },
			icon("i-close"),
		);

	function render() {
		const { link, lostAt, retryAt, run, basis, notes, server } = store.get();
		/** @type {HTMLElement[]} */
		const all = [];
		if (link === "lost") {
			const seconds = Math.max(0, Math.ceil((retryAt - Date.now()) / 1000));
			const since = new Date(lostAt).toLocaleTimeString([], { hour12: false });
			const wait = seconds > 0 ? `Next try in ${seconds} s.` : "Trying now.";
			all.push(
				note(
					"bad",
					`No connection since ${since}`,
					`What was loaded can still be looked at; parameters are locked until the server is back. ${wait}`,
					[button("Try now", retry)],
				),
			);
		}
		if (run?.state === "failed" && dismissed !== run.key) {
			const next =
				basis && basis !== run.key
					? "The run before is still shown."
					: "Change a parameter, or choose another method.";
			all.push(
				note(
					"bad",
					`The run stopped at step ${run.done}`,
					`${sentence(run.error ?? "The terminal says more").replace(/\.$/, "")}. ${next}`,
					[
						server?.changed.length ? button("Reset all parameters", () => actions.reset()) : null,
						button("Try again", actions.runAgain),
						close(() => ((dismissed = run.key), render())),
					],
				),
			);
		}
		const odd = [...(server?.sequence?.warnings ?? []), ...(run?.warnings ?? [])].join(". ");
		const hide = () => ((heard = odd), render());
		if (odd && odd !== heard) all.push(note("warn", "Worth knowing", odd, [close(hide)]));
		// What takes back an edit says so while that is the last one.
		const current = notes.filter(
			({ remedy }) => !remedy?.edit || remedy.edit === server?.edits.undo,
		);
		for (const { id, level, title, text, remedy, times } of current.toReversed()) {
			const kind = { error: "bad", warn: "warn", info: "busy" }[level];
			const gone = () => remove([id]);
			const mend = () => {
				gone();
				remedy?.act();
			};
			const words = times > 1 ? `${title} (${times} times)` : title;
			all.push(note(kind, words, text, [remedy ? button(remedy.word, mend) : null, close(gone)]));
			if (level !== "info" || going.has(id)) continue;
			going.add(id);
			setTimeout(expire, STANDS_MS, id);
		}
		const more = all.length - MOST;
		if (more > 0) {
			all.length = MOST;
			const ids = notes.map(({ id }) => id);
			all.push(note("", `${more} more`, "", [button("Dismiss all", () => remove(ids))]));
		}
		// A run tells ten times a second how far it is: what stands there stays, or the button under a
		// pointer would be another before it is let go.
		const now = [
			run?.state === "failed" && run.key,
			...notes.map(({ id }) => id),
			...all.map(({ outerHTML }) => outerHTML),
		].join();
		if (now !== standing) {
			const held = root.contains(document.activeElement);
			fill(root, all);
			if (held) root.querySelector("button")?.focus();
		}
		standing = now;
		clearInterval(ticking);
		if (link === "lost")
			ticking = setInterval(() => root.contains(document.activeElement) || render(), 1000);
	}

	store.watch(["link", "retryAt", "run", "basis", "notes", "server"], render);
}
