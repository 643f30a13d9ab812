/**
 * What is read off the timeline: the words under the pointer, the braid of identities, plots of a
 * track; and what two fingers ask of it.
 */
import { faded, stroke, trace } from "../draw/canvas.js";
import { drawGround, levels } from "../draw/rows.js";
import { capture, fill, h, icon, idTag, one, write } from "../elements/dom.js";
import { menuOf, opensMenu } from "../elements/over.js";
import { bucketOf, panned, secondsOf, xOf, zoomed } from "../play/clock.js";
import { fetcher, getJson } from "../state/api.js";
import { decisionsOf, scoresOf, shownVersion, stateAt } from "../state/events.js";

/* ---------- What the timeline's curves and lanes say under the pointer, in words beside it. */

/**
 * @param {Readonly<PageState>} state
 * @param {number} step
 * @param {Server.TrackLife | undefined} track  whose lane is pointed at
 * @returns {(Node | string)[][]} lines
 */
function hintLines(state, step, track) {
	const { timeline, fps, measure, span, frames } = state;
	/** Within which a mark is pointed at, steps. */
	const reach = Math.max(1, (span ? span[1] - span[0] : frames) / 150);
	/** @type {(Node | string)[][]} */
	const lines = [[h("b", `step ${step}`), ` · ${secondsOf(step, fps)} s`]];
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
function mountHint({ plot, at }, store) {
	const read = (/** @type {PointerEvent} */ event) => {
		const { step, track } = at(event);
		return store.get().sequence ? hintLines(store.get(), step, track) : [];
	};
	const card = h("div.card.hint-card", { hidden: true });
	plot.append(card);
	plot.addEventListener("pointermove", (event) => {
		// A finger or a pen has no other way to ask than to press.
		const seeks = event.buttons && event.pointerType === "mouse";
		const lines = seeks ? [] : read(event);
		card.hidden = lines.length === 0;
		if (card.hidden) return;
		fill(
			card,
			lines.map((line) => h("p", ...line)),
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

/* ---------- Two fingers on the timeline: apart or together for fewer or more steps, both aside
   to move. */

/** Fingers nearer than this are one thick one, CSS pixels. */
const NEAR = 20;

/** @param {HTMLElement} plot @param {Store<PageState>} store */
function mountFingers(plot, store) {
	/** Where each is, from the plot's left edge. @type {Map<number, number>} */
	const fingers = new Map();
	const place = (/** @type {PointerEvent} */ event) =>
		event.clientX - plot.getBoundingClientRect().left;

	capture(plot, "pointerdown", (event) => {
		if (event.pointerType !== "touch") return;
		fingers.set(event.pointerId, place(event));
		// A second one does not seek.
		if (fingers.size > 1) event.stopImmediatePropagation();
	});
	capture(plot, "pointermove", (event) => {
		const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
		const before = fingers.get(event.pointerId);
		if (before === undefined || other === undefined) return;
		event.stopImmediatePropagation();
		const now = place(event);
		fingers.set(event.pointerId, now);
		const { span, frames } = store.get();
		const [first, last] = span ?? [0, Math.max(1, frames - 1)];
		const far = (/** @type {number} */ at) => Math.max(NEAR, Math.abs(at - other));
		const middle = (now + other) / 2;
		const view = zoomed(
			{ first, last, width: plot.clientWidth },
			far(before) / far(now),
			middle,
			frames,
		);
		const aside = (middle - (before + other) / 2) / plot.clientWidth;
		const seen = panned(view, -aside * (view.last - view.first), frames);
		store.set({ span: [seen.first, seen.last] });
	});
	for (const kind of /** @type {const} */ (["pointerup", "pointercancel"]))
		plot.addEventListener(kind, ({ pointerId }) => fingers.delete(pointerId));
}

/* ---------- The braid of identities: who is followed by which track, and where that changes. */

/**
 * By which track each person is followed, from switch to switch.
 * @param {Server.PersonInfo[]} people
 * @param {Server.Switch[]} switches
 * @returns {{person: number, own: number, parts: {from: number, to: number, track: number}[]}[]}
 * those that are followed at all; `own` is the track that stands for the person
 */
export function strands(people, switches) {
	return people.flatMap(({ id, first, last, track }) => {
		if (track === null) return [];
		const own = switches.filter(({ person }) => person === id).sort((a, b) => a.step - b.step);
		const starts = [first, ...own.map(({ step }) => step)];
		const tracks = [own[0]?.before ?? track, ...own.map((one) => one.track)];
		const parts = starts.map((from, k) => ({ from, to: starts[k + 1] ?? last, track: tracks[k] }));
		return [{ person: id, own: track, parts }];
	});
}

/**
 * A line a person, at the height of the track that follows him and in the colour of the track
 * that stands for him: where two exchange their tracks, their lines cross.
 * @param {Pen} pen
 * @param {Server.Scores} scores
 * @param {Server.TrackLife[]} tracks  in the order of the lanes
 * @param {number | null} selection  whose strands stand out
 */
function drawBraid({ g, row, view, ink }, { evaluation, series }, tracks, selection) {
	const all = strands(evaluation.per_person, series.switches);
	const carrying = new Set(all.flatMap(({ parts }) => parts.map(({ track }) => track)));
	const order = tracks.map(({ id }) => id).filter((id) => carrying.has(id));
	const apart = (row.height - 12) / Math.max(1, order.length - 1);
	const level = (/** @type {number} */ id) => row.y + 6 + Math.max(0, order.indexOf(id)) * apart;
	g.save();
	g.beginPath();
	g.rect(0, row.y, view.width, row.height);
	g.clip();
	for (const { person, own, parts } of all) {
		const course = series.errors.find((one) => one.person === person);
		const near = { first: course?.first ?? 0, stride: series.stride };
		const paired = (/** @type {number} */ step) =>
			(course?.values[bucketOf(step, near)] ?? null) !== null;
		for (const lost of [true, false]) {
			g.beginPath();
			parts.forEach(({ from, to, track }, k) => {
				const y = level(track);
				const [x0, x1] = [Math.max(0, xOf(from, view)), Math.min(view.width, xOf(to, view))];
				// Over to the next lane within a few pixels, as a strand goes over another.
				if (k && !lost) {
					g.moveTo(x0 - 4, level(parts[k - 1].track));
					g.lineTo(x0 + 4, y);
				}
				const slope = (view.last - view.first) / view.width;
				for (let x = x0, open = false; x < x1; x += 1) {
					const here = paired(Math.round(view.first + x * slope)) !== lost;
					if (here) g[open ? "lineTo" : "moveTo"](x, y);
					open = here;
				}
			});
			const meant = selection === null || parts.some(({ track }) => track === selection);
			g.globalAlpha = meant ? 1 : 0.25;
			stroke(g, ink.id(own), lost ? 0.75 : order.length > 12 ? 1 : 2, lost ? [1, 3] : []);
		}
	}
	g.restore();
}

/* ---------- Strips of the selected track, under the others: added and taken away by a menu. */

/** @param {Context} context @param {TimelineSeam} timeline */
export function mountReading({ store, actions }, timeline) {
	mountHint(timeline, store);
	mountFingers(timeline.plot, store);
	timeline.braid = drawBraid;
	const gutter = one(".gut");
	const menu = menuOf({ class: "menu plots", "aria-label": "Plots of a track" });
	const button = h(
		"button.btn",
		{
			"data-tip": "Plots of the selected track: height, speed, what each camera makes of it",
			"aria-haspopup": "true",
		},
		"Plots",
		icon("i-down", "s"),
	);
	opensMenu(button, menu);
	one(".trans .grow").before(button, menu);
	/** @type {Server.CourseKind[]} */
	let kinds = [];
	/** @type {Server.Courses | null} */
	let told = null;
	/** What is asked of the server stands for this. */
	let asked = "";
	/** @type {Map<string, {element: HTMLElement, value: HTMLElement, sub: HTMLElement}>} */
	const rows = new Map();

	const part = () => {
		const { span } = store.get();
		return span ? `first=${Math.floor(span[0])}&last=${Math.ceil(span[1])}` : "first=0";
	};
	/** Whose plots they are: the selected track's, or the last one's that was. @type {number | null} */
	let whose = null;
	const refresh = fetcher(async () => {
		const { plots, basis, sequence, timeline: lanes } = store.get();
		if (!plots.length || whose === null || !sequence || !basis) {
			if (told) ((told = null), (asked = ""), timeline.draw(), values());
			return;
		}
		const wanted = plots.map((name) => `&kind=${name}`).join("");
		const key = `${whose}?${part()}${wanted}`;
		const news = `${key} ${shownVersion(store.get())} ${lanes?.done} ${store.get().scores?.series.steps}`;
		if (news === asked) return;
		told = await getJson(`/api/courses/${key}`);
		asked = news;
		timeline.draw();
		values();
	});

	/** @param {string} name */
	function toggle(name) {
		const { plots } = store.get();
		store.set({
			plots: plots.includes(name) ? plots.filter((one) => one !== name) : [...plots, name],
		});
	}

	const courseOf = (/** @type {string} */ name) =>
		told?.courses.find((course) => course.name === name);

	function list() {
		const { plots, sequence } = store.get();
		const offered = kinds.filter(({ needs_truth: needs }) => !needs || sequence?.has_truth);
		fill(
			menu,
			offered.map(({ name, word, help }) =>
				h(
					"label",
					h("input", {
						type: "checkbox",
						id: `plot-${name}`,
						...(plots.includes(name) ? { checked: true } : {}),
						onchange: () => toggle(name),
					}),
					h("b", word),
					h("span.small", help),
				),
			),
		);
		const shown = plots.filter((name) => offered.some((kind) => kind.name === name));
		for (const [name, { element }] of rows)
			if (!shown.includes(name)) (element.remove(), rows.delete(name));
		for (const name of shown) {
			const { word, help } = /** @type {Server.CourseKind} */ (
				offered.find((kind) => kind.name === name)
			);
			const [value, sub] = [h("span.r"), h("span.lg")];
			const away = h(
				"button",
				{ "aria-label": `Take ${word} away`, onclick: () => toggle(name) },
				icon("i-close", "s"),
			);
			const element =
				rows.get(name)?.element ??
				h(
					"div.gr.strip.plot-row",
					{ title: help },
					h("span.n", word),
					value,
					away,
					h("span.brk"),
					sub,
				);
			if (!rows.has(name)) rows.set(name, { element, value, sub });
			gutter.append(element);
		}
		timeline.rows = shown.map((name) => (pen) => draw(pen, name));
		one(".time").style.setProperty("--n-plots", String(shown.length));
		dispatchEvent(new Event("panes"));
		values();
		void refresh();
	}

	/** What is at the playhead, beside its plot. */
	function values() {
		const { shown } = store.get();
		for (const [name, { value, sub }] of rows) {
			const course = courseOf(name);
			const at = told ? bucketOf(Math.max(0, shown), told) : 0;
			const now = course?.values.map((curve) => curve[at] ?? null) ?? [];
			const text = (/** @type {number | null} */ number) => number?.toFixed(2) ?? "–";
			write(value, course?.cameras.length ? "" : `${text(now[0] ?? null)} ${course?.unit ?? ""}`);
			write(
				sub,
				whose === null
					? "select a track"
					: !course
						? "no such track here"
						: course.cameras.length
							? now.map((number, k) => `${k + 1}: ${text(number)}`).join("  ")
							: `track ${whose} · ${course.low}–${course.high} ${course.unit}`,
			);
		}
	}

	/** @param {Pen} pen @param {string} name */
	function draw(pen, name) {
		drawGround(pen);
		const course = courseOf(name);
		if (!told || !course) return;
		if (course.cameras.length) drawBands(pen, told, course.values);
		else drawCurve(pen, told, course);
	}

	store.on(["sequence"], () => (whose = null));
	store.watch(["selection"], ({ selection }) => (whose = selection ?? whose));
	store.watch(["plots", "sequence"], list);
	store.on(["selection", "basis", "revision", "timeline", "scores", "span"], refresh);
	store.on(["selection", "shown"], values);
	button.addEventListener("click", () => !kinds.length && void read());
	actions.plot = async (name) => {
		await read();
		if (name) toggle(name);
		else menu.togglePopover();
	};

	async function read() {
		if (kinds.length) return;
		const found = await getJson("/api/courses/kinds").catch(() => null);
		if (!found) return actions.note("error", "The list of plots cannot be read", "");
		kinds = found.kinds;
		list();
	}
	if (store.get().plots.length) void read();
}

/**
 * A curve between the ends of its axis; where the track is not there it stops.
 * @param {Pen} pen @param {Server.Courses} buckets @param {Server.TrackCourse} course
 */
function drawCurve({ g, row, view, ink }, buckets, { values: [values], low, high }) {
	const level = levels(row, low, high);
	/** @type {number[][]} */
	let points = [];
	const colour = ink.id(buckets.track);
	const end = () => {
		if (points.length > 1) stroke(trace(g, points), colour, 1.5);
		points = [];
	};
	values.forEach((value, k) => {
		const x = xOf(buckets.first + (k + 0.5) * buckets.stride - 0.5, view);
		if (value === null || x < -20 || x > view.width + 20) return end();
		points.push([Math.max(0, Math.min(view.width, x)), level(value)]);
	});
	end();
}

/**
 * A band a camera: the brighter the likelier.
 * @param {Pen} pen @param {Server.Courses} buckets @param {(number | null)[][]} curves
 */
function drawBands({ g, row, view, ink }, buckets, curves) {
	const height = (row.height - 8) / curves.length;
	const gap = height > 4 ? 1 : 0;
	const slope = (view.last - view.first) / view.width;
	curves.forEach((values, k) => {
		const y = row.y + 4 + k * height;
		for (let x = 0; x < view.width; x += 1) {
			const value = values[bucketOf(view.first + x * slope, buckets)];
			if (value === null || value === undefined) continue;
			g.fillStyle = faded(ink.id(buckets.track), 0.12 + 0.88 * value);
			g.fillRect(x, y, 1, Math.max(1, height - gap));
		}
	});
}
