// @ts-check
/** The timeline: one axis for range bar, ruler, lanes and strips, and one playhead over them. */
import { bucketOf, panned, secondsOf, stepAt, xOf, zoomed } from "../clock.js";
import { fill, h, idTag, parts, write } from "../dom.js";
import { hatch, prepare } from "../draw/canvas.js";
import { drawLanes, drawRange, drawRuler } from "../draw/lanes.js";
import { drawCardinality, drawErrors, drawParts, meanOf, scaleOf } from "../draw/strips.js";
import { isAlone, ordered, scoresOf } from "../events.js";
import { faded, palette } from "../palette.js";
import { shownDone } from "../playback.js";
import { mountTransport } from "./transport.js";

/** @type {Pane} */
export function mountTimeline(root, context) {
	const { store, actions, playback } = context;
	const { lanes, order, people, truthSign, parts: strip2, measure, value, countSign, referenceSign, axis, errors, error, whose, plot, fixed, empty, seek: seekBar, wanted, head, label: readout } = parts(root);
	mountTransport(root, context);
	order.addEventListener("click", () => store.set({ laneOrder: store.get().laneOrder === "longest" ? "born" : "longest" }));
	measure.addEventListener("click", () => store.set({ measure: store.get().measure === "ospa" ? "gospa" : "ospa" }));

	/** @type {View} */
	let view = { first: 0, last: 1, width: 1 };
	let frames = 0;
	let asked = false;
	let spoken = 0;

	const token = (/** @type {string} */ name) => parseFloat(getComputedStyle(document.documentElement).getPropertyValue(`--${name}`));

	/** Height of what stands over the lanes. */
	const above = () => token("h-over") + token("h-ruler");

	function resize() {
		view = { ...view, width: Math.max(1, plot.clientWidth - token("pad-end")) };
		draw();
		placeHead();
	}

	/** Another part is shown: of a long recording its values are fetched. */
	function look() {
		const whole = view.last - view.first >= frames - 1;
		const { timeline } = store.get();
		if (timeline && (timeline.stride > 1 || store.get().span)) store.set({ span: whole ? null : [view.first, view.last] });
		draw();
		placeHead();
	}

	function draw() {
		if (asked) return;
		asked = true;
		requestAnimationFrame(() => {
			asked = false;
			paint();
		});
	}

	/** @type {{of: any, by: string, tracks: TrackLane[]}} */
	let sorted = { of: null, by: "", tracks: [] };
	/** @returns {TrackLane[]} */
	function shownTracks() {
		const { timeline, laneOrder, selection } = store.get();
		if (timeline !== sorted.of || laneOrder !== sorted.by) {
			sorted = { of: timeline, by: laneOrder, tracks: ordered(timeline?.tracks ?? [], laneOrder) };
		}
		return isAlone(store.get()) ? sorted.tracks.filter(({ id }) => id === selection) : sorted.tracks;
	}

	/** What is plotted of the scores, made once for each of them. */
	function plotted() {
		const { measure: name } = store.get();
		const scores = scoresOf(store.get());
		if (scores !== plots.of || name !== plots.by) {
			const series = scores?.series;
			const total = series?.[name] ?? [];
			const reference = scores?.reference ?? null;
			const buckets = series ?? { first: 0, stride: 1 };
			// The parts are of powers in GOSPA and of roots in OSPA: drawn are their shares of the whole.
			const place = series ? series[`${name}_localisation`].map((part, k) => part / Math.max(1e-12, part + (name === "ospa" ? series.ospa_cardinality[k] : series.gospa_missed[k] + series.gospa_false[k]))) : [];
			const courses = series?.track_errors ?? [];
			const top = scaleOf([...total, ...(reference?.[name] ?? [])]);
			plots = { of: scores, by: name, total, reference, place, courses, buckets, top, mean: meanOf(courses, total.length, buckets), most: scaleOf(courses.flatMap((course) => course.values)) };
		}
		return plots;
	}
	/** @type {Plots} */
	let plots = { of: null, by: "ospa", total: [], reference: null, place: [], top: 1, buckets: { first: 0, stride: 1 }, courses: [], mean: [], most: 1 };

	/** The values at the playhead, beside their plots. */
	function writeScores() {
		const { shown, selection, measure: name } = store.get();
		const { of, total, reference, top, buckets, courses, mean, most } = plotted();
		const at = bucketOf(Math.max(0, shown), buckets);
		const unit = of?.series.unit ?? "";
		const text = (/** @type {number | null | undefined} */ number) => number?.toFixed(2) ?? "–";
		write(value, reference ? `A ${text(reference[name][at])} · B ${text(total[at])} ${unit}` : `${text(total[at])} ${unit}`);
		write(axis, `0–${top}`);
		write(measure, name.toUpperCase());
		measure.dataset.tip = `${of?.series.cost ?? "not scored yet"}; press for ${name === "ospa" ? "GOSPA" : "OSPA"}`;
		countSign.dataset.tip = name === "ospa" ? "number of people" : "missed and false people";
		referenceSign.hidden = !reference;
		const course = courses.find(({ track }) => track === selection);
		write(error, `${text(course ? course.values[at - bucketOf(course.first, buckets)] : mean[at])} ${unit}`);
		write(whose, `${course ? `track ${course.track}` : "mean"} in front · 0–${most} ${unit}`);
	}

	function paint() {
		const { timeline, range, selection, hover, server, loop } = store.get();
		const ink = palette();
		const height = plot.clientHeight;
		const g = prepare(fixed, plot.clientWidth, height);
		const over = { y: 0, height: token("h-over") };
		const ruler = { y: over.height, height: token("h-ruler") };
		const laneHeight = token("h-lane");
		const block = { y: ruler.y + ruler.height, height: lanes.offsetHeight };
		const strip = { y: block.y + block.height, height: token("h-strip") };
		if (frames < 1) return;
		if (loop && (range[0] !== null || range[1] !== null)) {
			const x0 = xOf(Math.max(view.first, range[0] ?? 0), view);
			const x1 = xOf(Math.min(view.last, range[1] ?? frames - 1), view);
			g.fillStyle = faded(ink.get("accent"), 0.07);
			if (x1 > x0) g.fillRect(x0, ruler.y, x1 - x0, height - ruler.y);
		}
		const done = shownDone(store.get());
		const fps = server?.sequence?.fps ?? 25;
		drawLanes(g, block, view, { tracks: shownTracks(), scroll: lanes.scrollTop, laneHeight, done: timeline?.done ?? 0, fps, selection, hover: hover?.id ?? null, switches: scoresOf(store.get())?.series.switches ?? [] }, ink);
		drawRange(g, over, view, { loaded: playback.loadedSteps(), done, frames }, ink);
		drawRuler(g, ruler, view, { range }, ink);
		if (timeline) drawCardinality(g, strip, view, timeline, ink);
		if (!strip2.hidden) {
			const plots = plotted();
			drawParts(g, { ...strip, y: strip.y + strip.height }, view, plots, ink);
			if (errors.offsetHeight) drawErrors(g, { ...strip, y: strip.y + 2 * strip.height }, view, plots, selection, ink);
		}
		if (done < frames) {
			const x = Math.max(0, xOf(done, view));
			hatch(g, x, block.y, view.width - x, height - block.y - 2, ink.get("line"), 6);
		}
	}

	/** The playhead moves by transform alone; nothing is drawn again while it plays. */
	function placeHead() {
		const { shown, step, server, result, basis, playing } = store.get();
		const at = Math.max(0, shown);
		const x = xOf(at, view);
		head.hidden = frames < 1 || x < -1 || x > view.width + 1;
		head.style.transform = `translateX(${Math.round(x)}px)`;
		write(readout, String(at));
		readout.style.marginLeft = `${Math.max(0, 17 - x)}px`;
		wanted.hidden = step === shown || Math.abs(xOf(step, view) - x) < 2;
		wanted.style.transform = `translateX(${Math.round(xOf(step, view))}px)`;
		if (seekBar.valueAsNumber !== step) seekBar.value = String(step);
		const now = performance.now();
		if (!playing || now - spoken > 1000) {
			spoken = now;
			const fps = server?.sequence?.fps ?? 25;
			const count = result?.computed ? `, ${result.tracks.length} people` : "";
			seekBar.setAttribute("aria-valuetext", `step ${at} of ${frames}, ${secondsOf(at, fps)} s${count}`);
		}
		const current = result?.run === basis && result.computed ? result : null;
		const truth = server?.sequence?.has_truth ? current?.truth.length : undefined;
		fill(people, current?.tracks.length ?? "–", truth !== undefined && h("span", { class: "sub" }, ` of ${truth}`));
		if (!strip2.hidden) writeScores();
	}

	/** @type {Map<number, {element: HTMLElement, share: HTMLElement}>} */
	const labels = new Map();
	function listLanes() {
		const tracks = shownTracks();
		const ids = new Set(tracks.map((track) => track.id));
		for (const [id, { element }] of labels) {
			if (!ids.has(id)) {
				element.remove();
				labels.delete(id);
			}
		}
		const selection = store.get().selection;
		tracks.forEach((track, index) => {
			let label = labels.get(track.id);
			if (!label) {
				const share = h("span", { class: "r" });
				const element = h(
					"button",
					{
						class: "gr lane",
						"aria-label": `Track ${track.id}`,
						onclick: () => actions.select(track.id),
						onpointerenter: () => store.set({ hover: { id: track.id, camera: -1 } }),
						onpointerleave: () => store.set({ hover: null }),
					},
					idTag(track.id),
					share,
				);
				label = { element, share };
				labels.set(track.id, label);
			}
			label.element.setAttribute("aria-pressed", String(track.id === selection));
			write(label.share, `${Math.round(track.seen * 100)} %`);
			if (lanes.children[index] !== label.element) lanes.insertBefore(label.element, lanes.children[index] ?? null);
		});
		const { run, server, laneOrder } = store.get();
		write(order, laneOrder === "longest" ? "tracks, longest first" : "tracks, first born first");
		const idle = tracks.length === 0 && Boolean(server?.sequence);
		write(empty, !idle ? "" : run?.state === "computing" ? "" : run?.state === "failed" ? "The run failed before a track was found." : "No track was found with these parameters.");
		empty.style.top = `${above() + 8}px`;
	}

	plot.addEventListener("pointerdown", (/** @type {PointerEvent} */ event) => {
		if (event.button !== 0 || frames < 1) return;
		event.preventDefault();
		plot.setPointerCapture(event.pointerId);
		const box = plot.getBoundingClientRect();
		const lane = Math.floor((event.clientY - box.top - above() + lanes.scrollTop) / token("h-lane"));
		const inLanes = event.clientY - box.top > above() && event.clientY - box.top < above() + lanes.clientHeight;
		const track = shownTracks()[lane];
		const at = stepAt(event.clientX - box.left, view);
		if (inLanes && track && at >= track.first && at <= track.last) actions.select(track.id);
		store.set({ playing: 0 });
		playback.seek(at);
	});
	plot.addEventListener("pointermove", (/** @type {PointerEvent} */ event) => {
		if (!plot.hasPointerCapture(event.pointerId)) return;
		playback.seek(stepAt(event.clientX - plot.getBoundingClientRect().left, view));
	});
	plot.addEventListener(
		"wheel",
		(/** @type {WheelEvent} */ event) => {
			event.preventDefault();
			const box = plot.getBoundingClientRect();
			const overLanes = event.clientY - box.top > above() && lanes.scrollHeight > lanes.clientHeight;
			if (overLanes && !event.ctrlKey && !event.shiftKey) lanes.scrollTop += event.deltaY;
			else if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY)) {
				const pixels = event.deltaX || event.deltaY;
				view = panned(view, (pixels / view.width) * (view.last - view.first), frames);
			} else view = zoomed(view, Math.exp(event.deltaY * 0.0015), event.clientX - box.left, frames);
			look();
		},
		{ passive: false },
	);
	/** @param {number} factor */
	actions.zoom = (factor) => {
		const x = Math.max(0, Math.min(view.width, xOf(Math.max(0, store.get().shown), view)));
		view = zoomed(view, factor, x, frames);
		look();
	};
	plot.addEventListener("dblclick", () => actions.zoom(1e9));
	seekBar.addEventListener("input", () => playback.seek(seekBar.valueAsNumber));
	lanes.addEventListener("scroll", draw);

	store.on(["server"], ({ server }) => {
		const now = server?.sequence?.frames ?? 0;
		truthSign.hidden = strip2.hidden = errors.hidden = !server?.sequence?.has_truth;
		if (now === frames) return;
		frames = now;
		view = { ...view, first: 0, last: Math.max(1, frames - 1) };
		seekBar.max = String(Math.max(0, frames - 1));
		resize();
	});
	store.on(["timeline", "run", "basis", "laneOrder", "scores", "measure", "layers3d"], () => {
		listLanes();
		draw();
		placeHead();
	});
	store.on(["selection"], () => {
		listLanes();
		const { selection } = store.get();
		if (selection !== null) labels.get(selection)?.element.scrollIntoView({ block: "nearest" });
		draw();
		placeHead();
	});
	store.on(["range", "loop", "hover", "theme"], draw);
	store.on(["shown", "step", "result"], placeHead);
	let waiting = false;
	store.on(["loaded"], () => {
		// Pictures arrive many times a second; the bar needs a few of them only.
		if (waiting) return;
		waiting = true;
		setTimeout(() => {
			waiting = false;
			draw();
		}, 200);
	});
	listLanes();
	new ResizeObserver(resize).observe(plot);
	resize();
}
