/** What a study that is there tries: it cannot change. */
import { h, symbolOf } from "../elements/dom.js";
import { SEARCHES, rangesBlock, tag } from "./fields.js";
import { nameOf, valueOf } from "./words.js";

/** @param {Server.Study} study */
export function lockedParts(study) {
	const { definition: told } = study;
	/** @param {string} word @param {Child} value */
	const line = (word, value) =>
		h("div", { class: "pairline" }, h("span", {}, word), h("span", {}, value));
	const seeds = Array.isArray(told.seeds) ? told.seeds.length : told.seeds;
	return [
		h(
			"div",
			{ class: "blk" },
			h("h3", { class: "h" }, "Recordings"),
			h(
				"div",
				{ class: "tags" },
				told.recordings.map((/** @type {string} */ place) => tag(nameOf(place), false, place)),
			),
		),
		h(
			"div",
			{ class: "blk" },
			rangesBlock(
				study.varied.length,
				study.varied.map(({ label, symbol, help, low, high, log, choices: all }) =>
					h(
						"tr",
						{},
						h("td", { title: help }, h("span", { class: "lab" }, label), " ", symbolOf(symbol)),
						all.length
							? h("td", { class: "num", colspan: 3 }, all.map(valueOf).join(", "))
							: [
									h("td", { class: "num" }, valueOf(low)),
									h("td", { class: "num" }, valueOf(high)),
									h("td", {}, log ? "log" : "linear"),
								],
					),
				),
			),
		),
		h(
			"div",
			{ class: "blk" },
			h("h3", { class: "h" }, "Search"),
			line("trials", study.info.trials ?? "as many as fit"),
			line("seeds", seeds),
			line("search", SEARCHES.find(([key]) => key === told.search)?.[1] ?? told.search),
			told.minutes && line("at most", `${told.minutes} min`),
			line(
				"best is",
				study.objectives.map(({ name, higher }) => `${name} ${higher ? "↑" : "↓"}`).join(", "),
			),
		),
	];
}
