/** Where a study runs: on this machine, or on a cluster that exists. */
import { fill, h } from "../elements/dom.js";
import { sendJson } from "../state/api.js";
import { choiceCard, numberField } from "./form.js";

/** @typedef {{scheduler: string | null, workers: number}} Where */

/** As the server is told. @param {Where} where */
export const placeOf = ({ scheduler, workers }) =>
	scheduler === null ? { workers } : { scheduler };

/** @param {Where} where @param {{changed: () => void, edited: () => void}} on */
export function runsOn(where, { changed, edited }) {
	const address = h("input.field.addr", {
		value: where.scheduler ?? "",
		placeholder: "tcp://scheduler:8786",
		"aria-label": "Address of the Dask scheduler",
		oninput: () => {
			where.scheduler = address.value.trim();
			changed();
		},
	});
	const answer = h("span.small", { role: "status" });
	const test = h(
		"button.btn.box",
		{
			onclick: async () => {
				fill(answer, "asking…");
				const found = await sendJson("POST", "/api/studies/scheduler", {
					address: address.value.trim(),
				}).catch((error) => ({ error: error.message }));
				fill(
					answer,
					found.error ??
						`${found.workers} workers with ${found.threads} threads on ${found.machines.join(", ") || "no machine yet"}`,
				);
			},
		},
		"Test",
	);
	/** @param {boolean} here @param {string} title @param {...Child} rest */
	const choice = (here, title, ...rest) => {
		const on = here === (where.scheduler === null);
		const choose = () => {
			where.scheduler = here ? null : (where.scheduler ?? "");
			edited();
		};
		return choiceCard(on, title, choose, true, ...(on ? rest : []));
	};
	const workers = numberField(
		changed,
		"Workers",
		where.workers,
		(value) => (where.workers = value ?? 1),
		{
			min: 1,
			max: 1024,
			step: 1,
		},
	);
	return h(
		"div.blk",
		h("h3.h", "Runs on"),
		h(
			"div.stack",
			{ role: "radiogroup", "aria-label": "Runs on" },
			choice(true, "This machine", workers, h("span.small", "workers, behind the page")),
			choice(false, "Dask scheduler", address, test, answer),
		),
	);
}
