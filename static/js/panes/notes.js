// @ts-check
/** Notes under the top bar: what happened, what still works, what to do next. */
import { fill, h, icon } from "../dom.js";

/** @param {HTMLElement} root @param {Context} context */
export function mountNotes(root, { store, page, retry }) {
	/** @type {string} */
	let dismissed = "";
	/** @type {ReturnType<typeof setInterval> | undefined} */
	let ticking;

	/** @param {string} kind @param {string} title @param {string} text @param {(Node | null | false)[]} buttons */
	const note = (kind, title, text, buttons) =>
		h(
			"div",
			{ class: "note", role: kind === "bad" ? "alert" : null },
			h("span", { class: `dot ${kind}` }),
			h("h2", {}, title),
			h("span", { class: "group" }, buttons),
			text && h("p", {}, text),
		);

	const close = (/** @type {() => void} */ act) =>
		h("button", { class: "btn icon end", "aria-label": "Dismiss", "data-tip": "Dismiss", onclick: act }, icon("i-close"));

	function render() {
		const { link, lostAt, retryAt, run, basis, notes, server } = store.get();
		/** @type {HTMLElement[]} */
		const all = [];
		if (link === "lost") {
			const seconds = Math.max(0, Math.ceil((retryAt - Date.now()) / 1000));
			const since = new Date(lostAt).toLocaleTimeString([], { hour12: false });
			const wait = seconds > 0 ? `Next try in ${seconds} s.` : "Trying now.";
			all.push(
				note("bad", `No connection since ${since}`, `What was loaded can still be looked at; parameters are locked until the server is back. ${wait}`, [
					h("button", { class: "btn box", onclick: retry }, "Try now"),
				]),
			);
		}
		if (run?.state === "failed" && dismissed !== run.key) {
			const words = [run.error ?? "The terminal says more."];
			words.push(basis && basis !== run.key ? "The run before is still shown." : "Change a parameter, or choose another method.");
			all.push(
				note("bad", `The run stopped at step ${run.done}`, words.join(" "), [
					server?.changed.length ? h("button", { class: "btn box", onclick: () => page.reset() }, "Reset all parameters") : null,
					h("button", { class: "btn box", onclick: page.runAgain }, "Try again"),
					close(() => {
						dismissed = run.key;
						render();
					}),
				]),
			);
		}
		for (const { id, level, title, text, again } of notes) {
			all.push(
				note(level === "error" ? "bad" : level === "warn" ? "warn" : "busy", title, text, [
					again ? h("button", { class: "btn box", onclick: again }, "Try again") : null,
					close(() => store.set({ notes: store.get().notes.filter((other) => other.id !== id) })),
				]),
			);
		}
		fill(root, all);
		clearInterval(ticking);
		if (link === "lost") ticking = setInterval(countdown, 1000);
	}

	function countdown() {
		if (store.get().link === "lost" && !root.contains(document.activeElement)) render();
	}

	store.on(["link", "retryAt", "run", "basis", "notes"], render);
	render();
}
