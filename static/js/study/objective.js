/** What trials are judged by: figures against the truth, or agreement where nobody knows it. */
import { choices, h } from "../elements/dom.js";
import { choiceCard } from "./fields.js";

/** @import { Wish } from "./form.js" */

/**
 * @param {Wish} now
 * @param {Server.ObjectiveInfo[]} figures  all that there are
 * @param {{hasTruth: boolean, cameras: number}} of  the recording that is open
 * @param {{changed: () => void, show: () => void}} on
 */
export function objectiveCards(now, figures, { hasTruth, cameras }, { changed, show }) {
	const leads = {
		truth: figures.filter(({ of }) => of !== "agreement"),
		agreement: figures.filter(({ of }) => of === "agreement"),
	};
	const byAgreement = leads.agreement.some(({ key }) => key === now.objectives[0]);
	/** @param {string[]} next */
	const set = (next) => {
		now.objectives = [...new Set(next.filter(Boolean))];
		show();
		changed();
	};

	/** @param {number} place @param {string} word @param {Server.ObjectiveInfo[]} from */
	const chooser = (place, word, from) => {
		const free = from.filter(
			({ key }) => now.objectives[place] === key || !now.objectives.includes(key),
		);
		const select = h("select", {
			class: "field",
			"aria-label": word,
			onchange: () => set(now.objectives.with(place, select.value)),
		});
		if (place === now.objectives.length)
			select.onchange = () => set([...now.objectives, select.value]);
		choices(
			select,
			[
				...(place ? [/** @type {[string, string]} */ (["", "nothing else"])] : []),
				...free.map(
					({ key, name, higher }) =>
						/** @type {[string, string]} */ ([
							key,
							`${name}, ${higher ? "more" : "less"} is better`,
						]),
				),
			],
			now.objectives[place] ?? "",
		);
		return h("label", {}, h("span", {}, word), select);
	};

	/** @param {"truth" | "agreement"} kind @param {string} title @param {string} beside @param {...Child} rest */
	const card = (kind, title, beside, ...rest) => {
		const on = byAgreement === (kind === "agreement");
		const can = leads[kind].length > 0 && (kind === "agreement" || hasTruth);
		return choiceCard(
			on,
			title,
			() => !on && set([usual(kind)]),
			on || can,
			h("span", { class: "small beside" }, beside),
			...rest,
		);
	};
	/** @param {"truth" | "agreement"} kind */
	const usual = (kind) =>
		(leads[kind].find(({ key }) => kind === "agreement" || key === "idf1") ?? leads[kind][0]).key;
	const others = figures.filter(({ of }) => hasTruth || of !== "truth");
	const lead = figures.find(({ key }) => key === now.objectives[0]);
	const [known] = leads.agreement;

	return h(
		"div",
		{ class: "blk" },
		h("h3", { class: "h" }, "Objective"),
		h(
			"div",
			{ role: "radiogroup", "aria-label": "Objective", class: "stack" },
			card(
				"truth",
				"Truth",
				hasTruth ? "" : "not there",
				!byAgreement && chooser(0, "best is", leads.truth),
				h(
					"span",
					{ class: "small", title: byAgreement ? null : lead?.help },
					hasTruth
						? "mean over recordings and seeds of a figure against the truth"
						: "no one knows where people were in this recording",
				),
			),
			card(
				"agreement",
				"Held-out camera",
				"no truth needed",
				h(
					"span",
					{ class: "small", title: known?.help },
					cameras > 1
						? "do runs backwards and without each camera find the same people? None is best whose people miss the boxes of a camera that was left out"
						: "one camera cannot be left out: only the run backwards is held against it",
				),
				byAgreement &&
					h(
						"span",
						{ class: "small warn" },
						"a tracker can be consistently wrong: look at the best trial before you use it",
					),
			),
		),
		h(
			"div",
			{ class: "stack" },
			now.objectives.length > 0 && chooser(1, "against", others),
			now.objectives.length > 1 && chooser(2, "and", others),
		),
	);
}
