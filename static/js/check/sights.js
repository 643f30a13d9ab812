/** The film of somebody who may be missing: where each camera would have him. */
import { palette } from "../draw/colours.js";
import { fill, h } from "../elements/dom.js";
import { drawCrop } from "./crops.js";
import { filmSteps } from "./words.js";

/** @typedef {Doubt["sights"]} Sights */

/** A camera's, in the order of steps. @param {Sights} sights @param {number} camera */
const of = (sights, camera) => sights.filter((one) => one.camera === camera);

/** The cameras, those first that would have him at most of the steps. @param {Sights} sights @param {number} cameras */
export const camerasOf = (sights, cameras) =>
	Array.from({ length: cameras }, (_, camera) => camera).sort(
		(a, b) => of(sights, b).length - of(sights, a).length || a - b,
	);

/**
 * Fill a film with what a camera shows there.
 * @param {HTMLElement} film @param {Sights} sights @param {number} camera
 * @param {{views: PageState["cameras"], crops: ReturnType<typeof import("./crops.js").createCrops>, seek: (step: number) => void}} page
 * @returns {number[]} its steps
 */
export function fillSights(film, sights, camera, { views, crops, seek }) {
	const own = of(sights, camera);
	const shown = filmSteps(0, own.length - 1, { frames: own.length, fps: 1 }).map((k) => own[k]);
	const name = views[camera]?.name ?? "";
	film.ariaLabel = `Pictures of who may be missing by ${name}`;
	film.style.setProperty("--rows", "1");
	const canvases = shown.map(() => h("canvas", { "aria-hidden": "true" }));
	fill(
		film,
		...shown.map(({ step }, k) =>
			h("span", { class: "fs in", "--column": k + 2, "data-at": step }, step),
		),
		h("span", { class: "fid", "--row": 2 }, "?"),
		...shown.map(({ step }, k) =>
			h(
				"button",
				{
					class: "fr in",
					"--row": 2,
					"--column": k + 2,
					"--c": "var(--warn)",
					"data-at": step,
					"aria-label": `Step ${step} by ${name}`,
					onclick: () => seek(step),
				},
				canvases[k],
			),
		),
	);
	shown.forEach(async ({ step, box }, k) => {
		const bitmap = await crops.pictureOf(camera, step);
		if (canvases[k].isConnected) drawCrop(canvases[k], bitmap, box, palette().id(1));
	});
	return shown.map(({ step }) => step);
}
