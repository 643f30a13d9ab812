/** Strips of the selected track, under the others of the timeline: added and taken away by a menu. */
import { faded } from "../draw/colours.js";
import { drawGround } from "../draw/strips.js";
import { stroke, trace } from "../draw/canvas.js";
import { all, fill, h, icon, one, write } from "../elements/dom.js";
import { bucketOf, xOf } from "../play/clock.js";
import { fetcher, getJson } from "../state/api.js";
import { shownVersion } from "../state/events.js";

/** @param {Context} context @param {TimelineSeam} timeline */
export function mountPlots({ store, actions }, timeline) {
	const gutter = one(".gut");
	const menu = h("div", { class: "menu plots", popover: "auto", "aria-label": "Plots of a track" });
	const button = h(
		"button",
		{
			class: "btn",
			"data-tip": "Plots of the selected track: height, speed, what each camera makes of it",
			"aria-haspopup": "true",
		},
		"Plots",
		icon("i-down", "s"),
	);
	button.popoverTargetElement = menu;
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
					{},
					h("input", {
						type: "checkbox",
						id: `plot-${name}`,
						...(plots.includes(name) ? { checked: true } : {}),
						onchange: () => toggle(name),
					}),
					h("b", {}, word),
					h("span", { class: "small" }, help),
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
			const [value, sub] = [h("span", { class: "r" }), h("span", { class: "lg" })];
			const away = h(
				"button",
				{ "aria-label": `Take ${word} away`, onclick: () => toggle(name) },
				icon("i-close", "s"),
			);
			const element =
				rows.get(name)?.element ??
				h(
					"div",
					{ class: "gr strip plot-row", title: help },
					h("span", { class: "n" }, word),
					value,
					away,
					h("span", { class: "brk" }),
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
	menu.addEventListener("toggle", (event) => {
		if (/** @type {ToggleEvent} */ (event).newState !== "open") return;
		const { left, top } = button.getBoundingClientRect();
		Object.assign(menu.style, { left: `${left}px`, bottom: `${innerHeight - top + 6}px` });
		all("input", menu)[0]?.focus();
	});
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
	const level = (/** @type {number} */ value) =>
		row.y +
		row.height -
		4 -
		((Math.min(high, Math.max(low, value)) - low) / (high - low)) * (row.height - 10);
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
