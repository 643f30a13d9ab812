/** Cards beside the boxes of a picture: what a track is made of, and whose a box is. */
import { fill, h, idTag, show } from "../elements/dom.js";

/** @param {Child | Child[]} word @param {Child[]} value */
const row = (word, ...value) => [h("dt", {}, word), h("dd", {}, ...value)];

/** @param {number} number @param {string} text */
const about = (number, text) => [show(Number(number.toFixed(2))), h("small", {}, text)];

/**
 * @param {HTMLElement} card
 * @param {Server.CameraTrack} track
 * @param {Server.Track | undefined} whole
 * @param {Server.Decided[]} decisions  what smoothing made otherwise of it, the nearest first
 */
export function fillTrackCard(card, track, whole, decisions) {
	const {
		id,
		seen,
		detection_probability: p,
		hidden_by: front,
		reason,
		source,
		fed_by: fed,
	} = track;
	fill(
		card,
		h("h3", {}, idTag(id), seen ? "seen" : "coasting"),
		h(
			"dl",
			{},
			whole && row("existence", whole.existence.toFixed(2)),
			p !== null &&
				row(
					[h("i", {}, "p"), h("sub", {}, "D")],
					show(Number(p.toFixed(3))),
					h("small", {}, front !== null ? ` hidden by ${front}` : reason ? ` ${reason}` : ""),
				),
			row(
				"fed by",
				...(seen && fed
					? [
							`box ${source + 1}`,
							h(
								"small",
								{},
								`, ${Math.round(100 * fed.share)} % sure, score ${show(Number(fed.weight.toPrecision(2)))}`,
							),
						]
					: ["no box here"]),
			),
			whole &&
				row(
					"at",
					whole.position.map((v) => v.toFixed(2).replace("-", "−")).join("  "),
					h("small", {}, " m"),
				),
			whole && row("±", whole.sigma.map((v) => v.toFixed(2)).join("  "), h("small", {}, " m")),
			whole?.height &&
				row(
					"height",
					whole.height[0].toFixed(2),
					h("small", {}, ` ± ${whole.height[1].toFixed(2)} m, standing`),
				),
		),
		decisions.slice(0, 2).map(({ words }) => h("p", { class: "decision" }, words)),
	);
}

/**
 * A box that the camera's filter was given.
 * @param {HTMLElement} card
 * @param {Server.Measurement} measurement
 * @param {number} index
 */
export function fillBoxCard(card, { score, track, nearest, sigmas, gate }, index) {
	const beyond = sigmas !== null && gate !== null ? sigmas - gate : 0;
	fill(
		card,
		h("h3", {}, `box ${index + 1}`, h("small", {}, track === null ? " nobody's" : " feeds")),
		h(
			"dl",
			{},
			row("score", ...about(score, "")),
			track !== null && row("track", idTag(track)),
			track === null &&
				(nearest === null || sigmas === null
					? row("nearest", "no track in this picture")
					: row("nearest track", idTag(nearest), " ", ...about(sigmas, " σ away"))),
			track === null &&
				gate !== null &&
				row(
					"gate",
					...about(gate, beyond > 0 ? ` σ: ${show(Number(beyond.toFixed(2)))} σ outside` : " σ"),
				),
		),
	);
}
