/** What the page says by itself: notes under the top bar, and three things to try. */
import { fill, h, icon } from "../elements/dom.js";
import { keyLabel } from "../state/commands.js";

/* ---------- What is seen, and three things to try: a card in the 3D view, until it is closed or
   all three were done. Help shows it again. */

/** Its name among what was closed for good. */
const TOUR = "tour";

const key = (/** @type {string} */ name) => h("kbd", {}, keyLabel(name));

/**
 * What can be tried, and how it is seen that somebody has.
 * @type {{
 *   word: string,
 *   key: string,
 *   text: (state: Readonly<PageState>) => Child[],
 *   done: (state: Readonly<PageState>) => boolean,
 * }[]}
 */
const THINGS = [
	{
		word: "Play on",
		key: "Space",
		text: ({ timeline }) =>
			timeline?.events.length
				? [key("n"), " goes to the next birth, end or exchange of numbers."]
				: ["The pictures, the room and the curves keep to the same step."],
		done: ({ playing }) => playing !== 0,
	},
	{
		word: "Doubt the cameras",
		key: "",
		text: ({ server }) => [
			`Detection probability is at ${server?.parameters["fusion.detection_probability"] ?? "–"}. `,
			"Pull its slider down: who is hidden then fades sooner.",
		],
		done: ({ server }) => Boolean(server?.changed.length),
	},
	{
		word: "Compare two settings",
		key: "p",
		text: () => [
			"It pins this run as A. Change a value: ",
			h("b", {}, "Compare"),
			" says which is better.",
		],
		done: ({ server }) => Boolean(server?.pinned),
	},
];

/** @type {Pane} */
export function mountTour(root, { store }) {
	/** @type {boolean[]} */
	let done = THINGS.map(() => false);
	const close = () => store.set({ dismissed: [...new Set([...store.get().dismissed, TOUR])] });

	function render() {
		const state = store.get();
		const { sequence, dismissed, run } = state;
		const shown = Boolean(sequence) && !dismissed.includes(TOUR);
		root.hidden = !shown;
		if (!shown) {
			done = THINGS.map(() => false);
			return;
		}
		done = THINGS.map(
			(thing, index) => done[index] || (run?.state === "done" && thing.done(state)),
		);
		if (done.every(Boolean)) return close();
		const count = sequence?.cameras.length ?? 0;
		const cameras = count === 1 ? "One camera watches" : `${count} cameras watch`;
		const next = done.indexOf(false);
		fill(
			root,
			h(
				"div",
				{ class: "tour-head" },
				h("h2", {}, "What you see"),
				h(
					"button",
					{
						class: "btn icon",
						"aria-label": "Close for good; Help shows it again",
						"data-tip": "Close for good; Help shows it again",
						onclick: close,
					},
					icon("i-close"),
				),
			),
			h(
				"p",
				{ class: "seen" },
				`${cameras} one room. A coloured body is a person the filter believes in, the line on `,
				"the floor where it came from; dashed in the pictures is the truth.",
			),
			THINGS.map(({ word, key: name, text }, index) =>
				h(
					"div",
					{ class: `thing${done[index] ? " done" : index === next ? " next" : ""}` },
					h("span", { class: "step" }, done[index] ? icon("i-tick", "s") : index + 1),
					h(
						"h3",
						{},
						word,
						name ? key(name) : "",
						done[index] && h("span", { class: "vh" }, "done"),
					),
					index === next && h("p", {}, ...text(state)),
				),
			),
		);
	}
	store.watch(["sequence", "dismissed", "playing", "server", "timeline"], render);
}

/** @type {Pane} */
export function mountNotes(root, { store, actions, retry }) {
	let dismissed = "";
	let heard = "";
	/** Whose notes stand there, and what they say. */
	let standing = "";
	/** @type {Timer} */
	let ticking;

	/** @type {(kind: string, title: string, text: string, buttons: (Node | null)[]) => HTMLElement} */
	const note = (kind, title, text, buttons) =>
		h(
			"div",
			{ class: "note", role: kind === "bad" ? "alert" : null },
			h("span", { class: `dot ${kind}` }),
			h("h2", {}, title),
			h("span", { class: "group" }, buttons),
			text && h("p", {}, text),
		);
	/** A sentence begins with a capital, unless it begins with a name of its own. @param {string} text */
	const sentence = (text) => text.replace(/^[a-z](?=[a-z]* )/, (letter) => letter.toUpperCase());
	const button = (/** @type {string} */ word, /** @type {() => void} */ onclick) =>
		h("button", { class: "btn box", onclick }, word);
	const close = (/** @type {() => void} */ onclick) =>
		h(
			"button",
			{ class: "btn icon", "aria-label": "Dismiss", "data-tip": "Dismiss", onclick },
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
						close(() => {
							dismissed = run.key;
							render();
						}),
					],
				),
			);
		}
		const odd = [...(server?.sequence?.warnings ?? []), ...(run?.warnings ?? [])].join(". ");
		const hide = () => {
			heard = odd;
			render();
		};
		if (odd && odd !== heard) all.push(note("warn", "Worth knowing", odd, [close(hide)]));
		for (const { id, level, title, text, remedy } of notes) {
			const kind = { error: "bad", warn: "warn", info: "busy" }[level];
			const gone = () => store.set({ notes: store.get().notes.filter((other) => other.id !== id) });
			const mend = () => {
				gone();
				remedy?.act();
			};
			all.push(note(kind, title, text, [remedy ? button(remedy.word, mend) : null, close(gone)]));
		}
		// A run tells ten times a second how far it is: what stands there stays, or the button under a
		// pointer would be another before it is let go.
		const whose = [run?.state === "failed" && run.key, ...notes.map(({ id }) => id)];
		const now = [...whose, ...all.map(({ outerHTML }) => outerHTML)].join();
		if (now !== standing) fill(root, all);
		standing = now;
		clearInterval(ticking);
		if (link === "lost")
			ticking = setInterval(() => root.contains(document.activeElement) || render(), 1000);
	}

	store.watch(["link", "retryAt", "run", "basis", "notes"], render);
}
