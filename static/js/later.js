/** What nobody needs before the first picture: read when the page is there. */
import { mountCorrecting } from "./check/edits.js";
import { fill, h, icon, one, parts, write } from "./elements/dom.js";
import { save, signButton } from "./elements/drawn.js";
import { mountTips } from "./elements/over.js";
import { mountBookmarks, mountIdentity, mountTables } from "./inspector/tables.js";
import { request } from "./state/api.js";
import { keyLabel } from "./state/commands.js";
import { mountReading } from "./timeline/reading.js";

/** @param {Context} context @param {TimelineSeam} timeline */
export function mountLater(context, timeline) {
	const { actions } = context;
	actions.saveFile = async (path, fallback) => {
		try {
			const response = await request(path);
			const named = /filename="?([^";]+)"?/.exec(response.headers.get("content-disposition") ?? "");
			save(await response.blob(), named?.[1] ?? fallback);
		} catch (error) {
			actions.refused(error, "export");
		}
	};
	const side = one(".side");
	mountTips();
	mountExport(parts(one(".top")), context);
	mountTour(one(".tour"), context);
	mountTables(side, context);
	mountIdentity(context);
	mountBookmarks(parts(side).marks, context);
	mountReading(context, timeline);
	mountCorrecting(context, timeline);
	timeline.draw();
}

/**
 * The run that is shown leaves in the same forms as those of the library.
 * @param {Record<string, Part>} top @param {Context} context
 */
function mountExport({ leaving, stopLeaving, leave }, { store, actions }) {
	/** @param {string} words @param {() => void} [cancel] */
	const say = (words, cancel) => {
		write(leaving, words);
		stopLeaving.hidden = !cancel;
		stopLeaving.onclick = cancel ?? null;
	};
	// Read when it is first wanted; from then on the button opens the menu by itself.
	actions.exportForms = async () => {
		const { exportMenu } = await import("./library/exports.js");
		leave.onclick = null;
		const [, menu] = exportMenu({ store, actions, say, chosen: () => [null], button: leave });
		leave.after(menu);
		menu.showPopover();
	};
}

/* ---------- What is seen, and three things to try: a card in the 3D view, until it is closed or
   all three were done. Help shows it again. */

/** Its name among what was closed for good. */
const TOUR = "tour";
const CLOSE = "Close for good; Help shows it again";

const key = (/** @type {string} */ name) => h("kbd", keyLabel(name));

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
			h("b", "Compare"),
			" says which is better.",
		],
		done: ({ server }) => Boolean(server?.pinned),
	},
];

/** @type {Pane} */
function mountTour(root, { store }) {
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
				"div.tour-head",
				h("h2", "What you see"),
				signButton("i-close", CLOSE, close, { "data-tip": CLOSE }),
			),
			h(
				"p.seen",
				`${cameras} one room. A coloured body is a person the filter believes in, the line on `,
				"the floor where it came from. Dashed in a picture is who is hidden there",
				sequence?.has_truth ? ", dashed and white the truth." : ".",
			),
			THINGS.map(({ word, key: name, text }, index) =>
				h(
					"div",
					{ class: `thing${done[index] ? " done" : index === next ? " next" : ""}` },
					h("span.step", done[index] ? icon("i-tick", "s") : index + 1),
					h("h3", word, name ? key(name) : "", done[index] && h("span.vh", "done")),
					index === next && h("p", ...text(state)),
				),
			),
		);
	}
	store.watch(["sequence", "dismissed", "playing", "server", "timeline"], render);
}
