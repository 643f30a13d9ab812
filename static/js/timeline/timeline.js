/**
 * The timeline: one axis for range bar, ruler, lanes and strips, one playhead over them, the buttons
 * that move it, and what a pointer asks of it.
 */
import { hatch, prepare, faded, palette } from "../draw/canvas.js";
import {
	drawLanes,
	drawRange,
	drawRuler,
	drawCardinality,
	drawErrors,
	drawParts,
} from "../draw/rows.js";
import { fill, h, idTag, parts, write, all, choices } from "../elements/dom.js";
import {
	bucketOf,
	panned,
	secondsOf,
	stepAt,
	tickUnder,
	xOf,
	zoomed,
	SPEEDS,
	parseStep,
} from "../play/clock.js";
import { shownDone } from "../play/playback.js";
import { isAlone, ordered, resultOf, scoresOf, trueCount } from "../state/events.js";

/* ---------- Play, step, speed, loop and the readout. ---------- */

/** @type {Pane} */
function mountTransport(root, { store, playback }) {
	const { play, read, step, of, seconds, typed, speed, loop, range, real, turn, hindsight } =
		parts(root);
	const close = () => {
		typed.hidden = true;
		read.hidden = false;
	};
	read.addEventListener("click", () => {
		typed.value = String(store.get().shown);
		typed.hidden = false;
		read.hidden = true;
		typed.select();
	});
	typed.addEventListener("blur", close);
	typed.addEventListener("keydown", (event) => {
		event.stopPropagation();
		const { fps, frames } = store.get();
		const wanted = event.key === "Enter" ? parseStep(typed.value, fps, frames) : null;
		if (wanted !== null) playback.seek(wanted);
		if (event.key === "Enter" || event.key === "Escape") close();
	});
	choices(
		speed,
		SPEEDS.map((value) => [value, `${value}×`]),
		1,
	);
	speed.addEventListener("change", () => {
		store.set({ speed: Number(speed.value) });
		speed.blur();
	});

	store.on(["shown", "sequence"], ({ shown, frames, fps }) => {
		write(step, String(Math.max(0, shown)));
		write(of, `/ ${Math.max(0, frames - 1)}`);
		write(seconds, secondsOf(Math.max(0, shown), fps));
		// Room for the largest number, so that nothing moves sideways.
		step.style.minWidth = `${String(frames).length}ch`;
		seconds.style.minWidth = `${secondsOf(frames, fps).length}ch`;
	});
	store.on(["playing"], ({ playing }) => {
		play.querySelector("use")?.setAttribute("href", playing ? "#i-pause" : "#i-play");
		play.ariaLabel = playing ? "Pause" : "Play";
	});
	const marks = () => {
		const {
			loop: on,
			range: [from, to],
			frames,
			speed: now,
		} = store.get();
		for (const control of all("button:not([data-command=maximise-time]), select", root))
			control.disabled = !frames;
		loop.ariaPressed = String(on);
		write(range, from === null && to === null ? "all" : `${from ?? 0} – ${to ?? frames - 1}`);
		speed.value = String(now);
	};
	store.watch(["loop", "range", "sequence", "speed"], marks);
	store.watch(["server", "link"], ({ server, link }) => {
		const method = server?.parameters.smoothing_method;
		hindsight.disabled = !method || link !== "open";
		write(hindsight, `smoothing ${method === "none" ? "off" : "on"}`);
		hindsight.ariaPressed = String(method !== "none");
	});
	store.watch(["realTime", "turn"], ({ realTime, turn: how }) => {
		write(real, realTime ? "real time" : "every step");
		write(turn, { page: "turns pages", centre: "centred", off: "stays" }[how]);
	});
}

/** CSS pixels from the playhead to the edge of its plate, and of the rim around that. */
const PLATE = 20;
/** What is said of steps that have tracks and no figures. */
const UNSCORED = "not scored yet";

/**
 * @param {HTMLElement} root
 * @param {Context} context
 * @returns {TimelineSeam} where others draw and ask
 */
export function mountTimeline(root, context) {
	const { store, actions, playback } = context;
	const {
		lanes,
		order,
		people,
		truthSign,
		scored,
		measure,
		value,
		countSign,
		referenceSign,
		axis,
		errors,
		error,
		whose,
		plot,
		fixed,
		braided,
		exchanged,
		empty,
		seek: seekBar,
		wanted,
		head,
		label: readout,
	} = parts(root);
	mountTransport(root, context);
	order.addEventListener("click", () =>
		store.set({ laneOrder: store.get().laneOrder === "longest" ? "born" : "longest" }),
	);
	measure.addEventListener("click", () =>
		store.set({ measure: store.get().measure === "ospa" ? "gospa" : "ospa" }),
	);

	/** @type {View} */
	let view = { first: 0, last: 1, width: 1 };
	let asked = false;
	let spoken = 0;
	/** The tick whose number the playhead would cut. @type {number | null} */
	let numberUnder = null;
	/** @type {TimelineSeam} */
	const seam = {
		plot,
		draw,
		rows: [],
		at: (event) => ({
			step: stepAt(event.clientX - plot.getBoundingClientRect().left, view),
			track: laneAt(event),
		}),
	};

	const token = (/** @type {string} */ name) =>
		parseFloat(getComputedStyle(document.documentElement).getPropertyValue(`--${name}`));

	/** Height of what stands over the lanes. */
	const above = () => token("h-over") + token("h-ruler") + token("h-check");

	/** Alone on the page its strips have the height that the lanes leave. */
	function share() {
		const { style } = document.documentElement;
		style.removeProperty("--h-strip");
		if (store.get().layout.max !== "time") return;
		const strips = all(".gr.strip:not([hidden])", root).length;
		const tall = shownTracks().length * token("h-lane");
		const room = plot.clientHeight - above();
		const each = (room - Math.min(tall, room / 2)) / Math.max(1, strips);
		style.setProperty("--h-strip", `${Math.floor(Math.max(token("h-strip"), each))}px`);
	}

	function resize() {
		share();
		view = { ...view, width: Math.max(1, plot.clientWidth - token("pad-end")) };
		draw();
		placeHead();
	}

	/** Another part is shown: of a long recording its values are fetched. @param {View} next */
	function look(next) {
		view = next;
		const whole = view.last - view.first >= store.get().frames - 1;
		store.set({ span: whole ? null : [view.first, view.last] });
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

	/** @type {{of: any, by: string, tracks: Server.TrackLife[]}} */
	let sorted = { of: null, by: "", tracks: [] };
	/** @returns {Server.TrackLife[]} */
	function shownTracks() {
		const { timeline, laneOrder, selection } = store.get();
		if (timeline !== sorted.of || laneOrder !== sorted.by) {
			sorted = { of: timeline, by: laneOrder, tracks: ordered(timeline?.tracks ?? [], laneOrder) };
		}
		return isAlone(store.get())
			? sorted.tracks.filter(({ id }) => id === selection)
			: sorted.tracks;
	}

	/** The values at the playhead, beside their plots. */
	function writeScores() {
		const { shown, selection, measure: name } = store.get();
		const { series, reference } = scoresOf(store.get()) ?? {};
		const unit = series?.unit ?? "";
		const text = (/** @type {number | null | undefined} */ number) => number?.toFixed(2) ?? "–";
		const whole = (/** @type {string} */ words) => (words === "–" ? words : `${words} ${unit}`);
		const valueOf = (/** @type {Server.EvaluationSeries | null | undefined} */ of) =>
			text(of?.[name][bucketOf(Math.max(0, shown), of)]);
		write(value, `${reference ? `A ${valueOf(reference)} · B ` : ""}${whole(valueOf(series))}`);
		write(axis, `0–${Math.max(series?.axes[name] ?? 0, reference?.axes[name] ?? 0)}`);
		write(measure, name.toUpperCase());
		measure.dataset.tip = `${series?.cost ?? "not scored yet"}; press for ${name === "ospa" ? "GOSPA" : "OSPA"}`;
		countSign.dataset.tip = name === "ospa" ? "number of people" : "missed and false people";
		referenceSign.hidden = !reference;
		const course =
			series?.track_errors.find(({ track }) => track === selection) ??
			(series && { first: series.first, values: series.mean_error, track: null });
		write(
			error,
			whole(
				text(
					course &&
						series &&
						course.values[bucketOf(Math.max(0, shown), { ...course, stride: series.stride })],
				),
			),
		);
		write(
			whose,
			`${course?.track ? `track ${course.track}` : "mean"} in front · 0–${series?.axes.error ?? 0} ${unit}`,
		);
	}

	function paint() {
		const { timeline, range, selection, hover, loop, frames, measure: name } = store.get();
		if (frames < 1) return;
		const ink = palette();
		const height = plot.clientHeight;
		const g = prepare(/** @type {any} */ (fixed), plot.clientWidth, height);
		let y = 0;
		/** The next row down. @param {number} height @returns {Pen} */
		const row = (height) => ({ g, view, ink, row: { y: (y += height) - height, height } });
		const [over, ruler] = [row(token("h-over")), row(token("h-ruler"))];
		const check = row(token("h-check"));
		const lanesRow = row(lanes.offsetHeight);
		const top = lanesRow.row.y;
		if (loop && (range[0] !== null || range[1] !== null)) {
			const [x0, x1] = [
				xOf(Math.max(view.first, range[0] ?? 0), view),
				xOf(Math.min(view.last, range[1] ?? frames - 1), view),
			];
			g.fillStyle = faded(ink.get("accent"), 0.07);
			if (x1 > x0) g.fillRect(x0, ruler.row.y, x1 - x0, height - ruler.row.y);
		}
		const done = shownDone(store.get());
		const { series, reference } = scoresOf(store.get()) ?? {};
		drawLanes(lanesRow, {
			tracks: shownTracks(),
			pinned: timeline?.pinned?.tracks ?? [],
			scroll: lanes.scrollTop,
			laneHeight: token("h-lane"),
			done: timeline?.done ?? 0,
			selection,
			hover: hover?.id ?? null,
			switches: series?.switches ?? [],
			decisions: timeline?.decisions ?? [],
		});
		seam.marks?.(check, lanesRow, { tracks: shownTracks(), scroll: lanes.scrollTop });
		drawRange(over, playback.loadedSteps(), done, frames);
		drawRuler(ruler, range, store.get().bookmarks, numberUnder);
		// Each plot has its row, whether there is something to plot or not.
		const scores = scoresOf(store.get());
		if (!braided.hidden && scores)
			seam.braid?.(row(token("h-strip")), scores, sorted.tracks, selection);
		const counts = row(token("h-strip"));
		if (timeline) drawCardinality(counts, timeline);
		/** The rows of the scores. @type {Pen["row"] | null} */
		let plotted = null;
		if (!scored.hidden) {
			const [costs, distances] = [0, 1].map(() => row(token("h-strip")));
			plotted = { y: costs.row.y, height: costs.row.height + distances.row.height };
			if (series) drawParts(costs, series, reference ?? null, name);
			if (series) drawErrors(distances, series, selection);
		}
		for (const drawRow of seam.rows) drawRow(row(token("h-strip")));
		/** Hatch steps of which something is not known. @param {number} from @param {number} to @param {Pen["row"]} where */
		const open = (from, to, { y, height }) => {
			const [x, end] = [from, to].map((step) => Math.max(0, Math.min(view.width, xOf(step, view))));
			hatch(g, [{ x, y, width: end - x, height }], ink.get("line"), 6);
			return { x, width: end - x };
		};
		if (done < frames) open(done, frames, { y: top, height: Math.max(0, height - top - 2) });
		const last = series?.steps ?? 0;
		if (plotted && last < done) {
			const { x, width } = open(last, done, plotted);
			g.fillStyle = ink.get("ink-3");
			g.font = `${ink.get("fs-0")} ${ink.font}`;
			g.textAlign = "left";
			if (width > g.measureText(UNSCORED).width + 16) g.fillText(UNSCORED, x + 8, plotted.y + 12);
		}
	}

	/** The playhead moves by transform alone; what is under it is drawn again where it cuts a number. */
	function placeHead() {
		const { shown, step, sequence, frames, fps, playing } = store.get();
		const result = resultOf(store.get());
		const at = Math.max(0, shown);
		const x = xOf(at, view);
		head.hidden = frames < 1 || x < -1 || x > view.width + 1;
		head.style.transform = `translateX(${Math.round(x)}px)`;
		write(readout, String(at));
		readout.style.marginLeft = `${Math.max(0, 17 - x)}px`;
		const under = head.hidden ? null : tickUnder(view, at, PLATE);
		if (under !== numberUnder) {
			numberUnder = under;
			draw();
		}
		wanted.hidden = step === shown || Math.abs(xOf(step, view) - x) < 2;
		wanted.style.transform = `translateX(${Math.round(xOf(step, view))}px)`;
		if (seekBar.valueAsNumber !== step) seekBar.value = String(step);
		const now = performance.now();
		if (!playing || now - spoken > 1000) {
			spoken = now;
			const count = result ? `, ${result.tracks.length} people` : "";
			seekBar.setAttribute(
				"aria-valuetext",
				`step ${at} of ${frames - 1}, ${secondsOf(at, fps)} s${count}`,
			);
		}
		fill(
			people,
			result?.tracks.length ?? "–",
			result && sequence?.has_truth && h("span.sub", ` of ${trueCount(result)}`),
		);
		if (!scored.hidden) writeScores();
	}

	/** @type {Map<number, HTMLElement>} */
	const labels = new Map();
	function listLanes() {
		const tracks = shownTracks();
		const ids = new Set(tracks.map((track) => track.id));
		for (const [id, label] of labels) if (!ids.has(id)) (label.remove(), labels.delete(id));
		const { selection } = store.get();
		tracks.forEach(({ id, seen, name }, index) => {
			const label =
				labels.get(id) ??
				h(
					"button.gr.lane",
					{
						onclick: (event) => (event.altKey ? actions.solo : actions.select)(id),
						onpointerenter: () => store.set({ hover: { id, camera: -1 } }),
						onpointerleave: () => store.set({ hover: null }),
					},
					idTag(id),
					h("span.who.cut"),
					h("span.r"),
				);
			labels.set(id, label);
			label.ariaLabel = `Track ${id}${name ? `, ${name}` : ""}`;
			write(/** @type {Node} */ (label.children[1]), name ?? "");
			label.ariaPressed = String(id === selection);
			write(/** @type {Node} */ (label.lastChild), `${Math.round(seen * 100)} %`);
			if (lanes.children[index] !== label) lanes.insertBefore(label, lanes.children[index] ?? null);
		});
		const { run, sequence, laneOrder, frames } = store.get();
		const switches = scoresOf(store.get())?.series.switches.length ?? 0;
		braided.hidden = switches === 0;
		write(exchanged, `${switches} switch${switches > 1 ? "es" : ""}`);
		fixed.ariaLabel = `Timeline: ${tracks.length} tracks over ${frames} steps, with the number of people and the errors; the tabs Tracks, Events and Step have it as tables`;
		const fit = Math.floor(lanes.clientHeight / token("h-lane"));
		const words = laneOrder === "longest" ? "longest first" : "first born first";
		// Who does not see all of them is told how many there are.
		write(order, fit < tracks.length ? `${fit} of ${tracks.length}, ${words}` : `tracks, ${words}`);
		const idle = tracks.length === 0 && sequence && run?.state !== "computing";
		write(
			empty,
			!idle
				? ""
				: run?.state === "failed"
					? "The run failed before a track was found."
					: !run?.done
						? ""
						: "No track was found with these parameters.",
		);
		empty.style.top = `${above() + 8}px`;
	}

	plot.addEventListener("pointerdown", (event) => {
		if (event.button !== 0 || !store.get().sequence) return;
		event.preventDefault();
		plot.setPointerCapture(event.pointerId);
		const box = plot.getBoundingClientRect();
		const track = laneAt(event);
		const at = stepAt(event.clientX - box.left, view);
		if (track && at >= track.first && at <= track.last) actions.select(track.id);
		store.set({ playing: 0 });
		playback.seek(at);
	});
	plot.addEventListener("pointermove", (event) => {
		if (!plot.hasPointerCapture(event.pointerId)) return;
		playback.seek(stepAt(event.clientX - plot.getBoundingClientRect().left, view));
	});
	plot.addEventListener(
		"wheel",
		(event) => {
			event.preventDefault();
			const box = plot.getBoundingClientRect();
			const { frames } = store.get();
			// The wheel zooms wherever the plot is; beside it, over the names, it scrolls the lanes.
			if (event.altKey) lanes.scrollTop += event.deltaY;
			else if (event.shiftKey || Math.abs(event.deltaX) > Math.abs(event.deltaY))
				look(
					panned(
						view,
						((event.deltaX || event.deltaY) / view.width) * (view.last - view.first),
						frames,
					),
				);
			else look(zoomed(view, Math.exp(event.deltaY * 0.0015), event.clientX - box.left, frames));
		},
		{ passive: false },
	);
	/** The track whose lane is under the pointer. @param {PointerEvent} event */
	function laneAt({ clientY }) {
		const y = clientY - plot.getBoundingClientRect().top - above();
		if (y < 0 || y >= lanes.clientHeight) return undefined;
		return shownTracks()[Math.floor((y + lanes.scrollTop) / token("h-lane"))];
	}
	actions.zoom = (factor) =>
		look(
			zoomed(
				view,
				factor,
				Math.max(0, Math.min(view.width, xOf(Math.max(0, store.get().shown), view))),
				store.get().frames,
			),
		);
	plot.addEventListener("dblclick", () => actions.zoom(1e9));
	seekBar.addEventListener("input", () => playback.seek(seekBar.valueAsNumber));
	lanes.addEventListener("scroll", draw);

	store.on(["span"], ({ span }) => {
		if (!span || (span[0] === view.first && span[1] === view.last)) return;
		look({ ...view, first: span[0], last: Math.min(span[1], store.get().frames - 1) });
	});
	store.on(["sequence"], ({ sequence, frames, span }) => {
		truthSign.hidden = scored.hidden = errors.hidden = !sequence?.has_truth;
		const [first, last] = span ?? [0, Math.max(1, frames - 1)];
		view = { ...view, first, last };
		seekBar.max = String(Math.max(0, frames - 1));
		resize();
	});
	store.on(["timeline", "run", "basis", "laneOrder", "scores", "measure", "layers3d"], () => {
		listLanes();
		resize();
	});
	store.on(["selection"], () => {
		listLanes();
		const { selection } = store.get();
		if (selection !== null) labels.get(selection)?.scrollIntoView({ block: "nearest" });
		draw();
		placeHead();
	});
	store.on(["range", "loop", "hover", "theme", "bookmarks"], draw);
	store.on(["shown", "step", "result"], placeHead);
	store.on(["shown"], ({ shown, frames, turn, playing }) => {
		if (turn === "off" && playing) return;
		if (turn === "centre") {
			const off = Math.round(shown - (view.first + view.last) / 2);
			const next = panned(view, off, frames);
			if (playing && next.first !== view.first) look(next);
		}
		// Of a part that is shown, the page is turned when the playhead leaves it.
		else if (shown > view.last) look(panned(view, shown - view.first, frames));
		else if (shown >= 0 && shown < view.first) look(panned(view, shown - view.last, frames));
	});
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
	addEventListener("panes", resize);
	new ResizeObserver(resize).observe(plot);
	resize();
	return seam;
}
