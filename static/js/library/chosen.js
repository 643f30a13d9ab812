/** The bar under the runs: what can be done with those that are ticked, and what was just done. */
import { fill, h, icon, one } from "../elements/dom.js";
import { grow, signButton } from "../elements/drawn.js";
import { exportMenu } from "./exports.js";
import { comparison } from "./small.js";
import { many, size } from "./words.js";

/**
 * @param {object} how
 * @param {Store<PageState>} how.store
 * @param {Actions} how.actions
 * @param {() => Server.KeptRunInfo[]} how.chosen
 * @param {() => void} how.none  choose none
 * @param {() => () => Promise<void>} how.leave  runs are about to go; the answer shows who is left
 */
export function chosenBar({ store, actions, chosen, none, leave }) {
	const numbers = () => chosen().map(({ id }) => id);
	const picked = h("b");
	const line = h("span.gone-line", { role: "status" });
	const stop = h("button.btn", "Stop");
	const side = h("button.btn.box", { onclick: compare }, icon("i-swap"), "Compare");
	/** @param {string} words @param {() => void} [cancel] */
	const say = (words, cancel) => {
		fill(line, words);
		stop.hidden = !cancel;
		stop.onclick = cancel ?? null;
		element.hidden = !words && !chosen().length;
	};
	const tools = h(
		"span.picked",
		{ role: "toolbar", "aria-label": "Chosen runs" },
		picked,
		side,
		exportMenu({ store, actions, say, chosen: numbers }),
		h("button.btn.box", { onclick: () => void remove(numbers()) }, icon("i-trash"), "Delete"),
		signButton("i-close", "Choose none", none),
	);
	const element = h("div.undo-line", tools, grow(), line, stop);

	function compare() {
		const dialog = /** @type {any} */ (one(".compare"));
		const close = () => dialog.close();
		fill(
			dialog,
			h("header", h("h2", "Runs side by side"), signButton("i-close", "Close", close)),
			...comparison(chosen(), store.get().schema),
		);
		// beside it; what is in it can be marked and copied
		dialog.onclick = (/** @type {Event} */ { target }) => void (target === dialog && close());
		dialog.showModal();
	}

	/** @param {number[]} ids */
	async function remove(ids) {
		if (!ids.length) return;
		const showRest = leave();
		/** @type {Server.Deleted | null} */
		const deleted = await actions.command("delete_runs", { runs: ids });
		none();
		await showRest();
		if (!deleted) return;
		const what = ids.length === 1 ? `Run ${ids[0]}` : many(ids.length, "run");
		await actions.noteEdit(`${what} deleted, ${size(deleted.bytes)}`, "");
	}

	return {
		element,
		remove,
		show() {
			const count = chosen().length;
			fill(picked, `${count} chosen`);
			tools.hidden = !count;
			side.disabled = count < 2 || count > 4;
			side.title = side.disabled ? "Two to four runs stand side by side" : "";
			stop.hidden = true;
			element.hidden = !count;
		},
	};
}
