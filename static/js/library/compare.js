/** Runs side by side: what differs between them, and their figures, the best of each bold. */
import { fill, h, icon } from "../elements/dom.js";
import { symbol } from "./runs.js";
import { figure, titleOf } from "./words.js";

/** Word, value, digits, and whether more is better; 0: neither. */
const ROWS = /** @type {[string, keyof Server.KeptRunInfo, number, number][]} */ ([
	["MOTA", "mota", 3, 1],
	["IDF1", "idf1", 3, 1],
	["HOTA", "hota", 3, 1],
	["OSPA, m", "ospa", 3, -1],
	["Position error, m", "position_error", 3, -1],
	["Missed", "misses", 0, -1],
	["False", "false_positives", 0, -1],
	["Identity switches", "id_switches", 0, -1],
	["Tracks", "targets", 0, 0],
	["Steps a second", "steps_per_second", 0, 0],
]);

/** @param {Server.KeptRunInfo[]} runs */
export function compare(runs) {
	const dialog = h("dialog", { class: "compare", "aria-label": "Runs side by side" });
	/** @param {Node | string} word @param {string[]} cells @param {number} [best] @param {string} [tip] */
	const row = (word, cells, best = -1, tip = "") =>
		h(
			"tr",
			{},
			h("th", { scope: "row", title: tip }, word),
			cells.map((cell, k) => h("td", { class: `num${k === best ? " top1" : ""}` }, cell)),
		);
	const changes = new Map(runs.flatMap((run) => run.changes.map((change) => [change.key, change])));
	const said = (/** @type {(run: Server.KeptRunInfo) => string} */ of) => runs.map(of);
	const differing = [
		["Single view", said((run) => run.single_view)],
		["Fusion", said((run) => run.fusion_method)],
		["Seed", said((run) => String(run.seed))],
		["Program", said((run) => (run.older_code ? `${run.version}, older code` : run.version))],
	].filter(([, cells]) => new Set(cells).size > 1);
	fill(
		dialog,
		h(
			"div",
			{ class: "sheet-head" },
			h("h2", { class: "pane-title" }, "Runs side by side"),
			h("span", { class: "grow" }),
			h(
				"button",
				{ class: "btn icon", "aria-label": "Close", onclick: () => dialog.close() },
				icon("i-close"),
			),
		),
		h(
			"div",
			{ class: "scroll" },
			h(
				"table",
				{},
				h(
					"thead",
					{},
					h(
						"tr",
						{},
						h("th", {}),
						runs.map((run) => h("th", { scope: "col", class: "num" }, titleOf(run))),
					),
				),
				h(
					"tbody",
					{},
					differing.map(([word, cells]) =>
						row(/** @type {string} */ (word), /** @type {string[]} */ (cells)),
					),
					[...changes.values()].map((change) =>
						row(
							symbol(change),
							runs.map(
								(run) => run.changes.find(({ key }) => key === change.key)?.value ?? change.default,
							),
							-1,
							change.key,
						),
					),
					ROWS.map(([word, key, digits, sign]) => {
						const values = runs.map((run) => /** @type {number | null} */ (run[key]));
						const known = values.filter((value) => value !== null);
						const top = sign * Math.max(...known.map((value) => sign * value));
						const alone = known.filter((value) => value === top).length === 1;
						return row(
							word,
							values.map((value) => figure(value, digits)),
							sign && alone && known.length > 1 ? values.indexOf(top) : -1,
						);
					}),
				),
			),
		),
	);
	dialog.addEventListener("close", () => dialog.remove());
	document.body.append(dialog);
	dialog.showModal();
}
