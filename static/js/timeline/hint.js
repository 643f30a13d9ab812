/** What the timeline's curves and lanes say under the pointer, in words beside it. */
import { bucketOf, secondsOf } from "../play/clock.js";
import { fill, h, idTag } from "../elements/dom.js";
import { decisionsOf, scoresOf, stateAt } from "../state/events.js";

/**
 * @param {Readonly<PageState>} state
 * @param {number} step
 * @param {Server.TrackLife | undefined} track  whose lane is pointed at
 * @returns {(Node | string)[][]} lines
 */
export function hintLines(state, step, track) {
	const { timeline, fps, measure, span, frames } = state;
	/** Within which a mark is pointed at, steps. */
	const reach = Math.max(1, (span ? span[1] - span[0] : frames) / 150);
	/** @type {(Node | string)[][]} */
	const lines = [[h("b", {}, `step ${step}`), ` · ${secondsOf(step, fps)} s`]];
	if (track) {
		const events = (timeline?.events ?? []).filter(
			([at, id]) => id === track.id && Math.abs(at - step) <= (timeline?.stride ?? 1),
		);
		const what = events.map(([, , kind]) => kind).join(", ");
		lines.push([idTag(track.id), ` ${stateAt(track, step)}${what && ` · ${what}`}`]);
		const near = decisionsOf(state, track.id, step)[0];
		if (near && Math.abs(near.step - step) <= reach) lines.push([near.words]);
	} else {
		const gone = (timeline?.decisions ?? []).filter(
			({ step: at, kind }) => kind === "removed" && Math.abs(at - step) <= reach,
		);
		for (const { track: id, words } of gone.slice(0, 3)) lines.push([idTag(id), ` ${words}`]);
	}
	if (timeline && step < timeline.done) {
		const at = bucketOf(step, timeline);
		const truth = timeline.truth ? ` of ${timeline.truth.mean[at]?.toFixed(0) ?? "–"}` : "";
		lines.push([`people ${timeline.count.mean[at]?.toFixed(0) ?? "–"}${truth}`]);
		const [mean, sigma] = [timeline.cardinality.mean[at], timeline.deviation.mean[at]];
		if (mean !== undefined) lines.push([`expected ${mean.toFixed(2)} ± ${sigma.toFixed(2)}`]);
	}
	const series = scoresOf(state)?.series;
	const cost = series?.[measure][bucketOf(step, series)];
	if (series && cost !== undefined)
		lines.push([`${measure.toUpperCase()} ${cost.toFixed(2)} ${series.unit}`]);
	const error = series?.mean_error[bucketOf(step, series)];
	if (series && error) lines.push([`mean error ${error.toFixed(2)} ${series.unit}`]);
	return lines;
}

/** @param {TimelineSeam} timeline @param {Store<PageState>} store */
export function mountHint({ plot, at }, store) {
	const read = (/** @type {PointerEvent} */ event) => {
		const { step, track } = at(event);
		return store.get().sequence ? hintLines(store.get(), step, track) : [];
	};
	const card = h("div", { class: "card hint-card", hidden: true });
	plot.append(card);
	plot.addEventListener("pointermove", (event) => {
		// A finger or a pen has no other way to ask than to press.
		const seeks = event.buttons && event.pointerType === "mouse";
		const lines = seeks ? [] : read(event);
		card.hidden = lines.length === 0;
		if (card.hidden) return;
		fill(
			card,
			lines.map((line) => h("p", {}, ...line)),
		);
		const box = plot.getBoundingClientRect();
		const [x, y] = [event.clientX - box.left, event.clientY - box.top];
		const left = x + 14 + card.offsetWidth > box.width ? x - 14 - card.offsetWidth : x + 14;
		const top = Math.max(
			2,
			Math.min(y - card.offsetHeight / 2, box.height - card.offsetHeight - 2),
		);
		card.style.transform = `translate(${Math.round(left)}px, ${Math.round(top)}px)`;
	});
	for (const kind of ["pointerleave", "pointerdown", "wheel"])
		plot.addEventListener(kind, () => (card.hidden = true), { passive: true });
}
