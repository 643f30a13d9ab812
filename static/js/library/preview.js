/** One kept run in small: lanes, people, ways from above, what differs. */
import { prepare, stroke, trace } from "../draw/canvas.js";
import { palette } from "../draw/colours.js";
import { fill, h } from "../elements/dom.js";
import { tickSteps } from "../play/clock.js";
import { symbol } from "./runs.js";
import { figure, many, titleOf, when } from "./words.js";

const [LEFT, LANE, MOST] = [62, 16, 6];

/** @param {HTMLCanvasElement} canvas @param {Server.Preview} told */
function drawLanes(canvas, { frames, tracks, people }) {
	const { clientWidth: width, clientHeight: height } = canvas;
	const [g, ink] = [prepare(canvas, width, height), palette()];
	const view = { first: 0, last: Math.max(1, frames - 1), width: width - LEFT - 12 };
	const x = (/** @type {number} */ step) => LEFT + (step / view.last) * view.width;
	g.font = `10px ${ink.font}`;
	g.textBaseline = "middle";
	g.textAlign = "center";
	for (let step = 0; step <= view.last; step += tickSteps(view).major) {
		const at = Math.round(x(step)) + 0.5;
		stroke(
			trace(g, [
				[at, 18],
				[at, height],
			]),
			ink.get("p-grid"),
			1,
		);
		g.fillStyle = ink.get("ink-3");
		g.fillText(String(step), at, 9);
	}
	const longest = [...tracks].sort((a, b) => b.last - b.first - (a.last - a.first));
	const lanes = longest.slice(0, MOST).sort((a, b) => a.first - b.first);
	lanes.forEach(({ id, spans }, index) => {
		const y = 29 + index * LANE;
		g.fillStyle = ink.id(id);
		g.fillRect(12, y - 6, 20, 13);
		g.fillStyle = ink.on(id);
		g.fillText(String(id), 22, y + 1);
		for (const [first, last, kind] of spans) {
			g.fillStyle = ink.id(id);
			if (kind === "seen") g.fillRect(x(first), y - 3, Math.max(1.5, x(last + 1) - x(first)), 6);
			else
				stroke(
					trace(g, [
						[x(first), y],
						[x(last + 1), y],
					]),
					ink.id(id),
					2,
					[2.5, 2],
				);
		}
	});
	g.textAlign = "left";
	g.fillStyle = ink.get("ink-3");
	const below = 24 + lanes.length * LANE;
	if (tracks.length > MOST) g.fillText(`and ${tracks.length - MOST} more`, LEFT, below + 4);
	const [top, bottom, most] = [below + 20, height - 6, Math.max(1, ...people)];
	g.fillStyle = ink.get("ink-2");
	g.font = `11px ${ink.font}`;
	g.fillText("People", 12, top + 4);
	g.fillStyle = ink.get("ink-3");
	g.font = `10px ${ink.font}`;
	g.fillText(`0–${Math.ceil(most)}`, 12, top + 18);
	stroke(
		trace(
			g,
			people.flatMap((count, k) =>
				[k, k + 1].map((at) => [
					LEFT + (at / people.length) * view.width,
					bottom - (count / most) * (bottom - top),
				]),
			),
		),
		ink.get("p-est"),
		1.25,
	);
}

/** @param {HTMLCanvasElement} canvas @param {Server.Preview} told */
function drawTop(canvas, { courses }) {
	const { clientWidth: width, clientHeight: height } = canvas;
	const [g, ink] = [prepare(canvas, width, height), palette()];
	const points = courses.flatMap(({ points }) => points);
	if (!points.length) return;
	const xs = points.map(([x]) => x).sort((a, b) => a - b);
	const ys = points.map(([, y]) => y).sort((a, b) => a - b);
	// A stray point far away does not make all others small.
	const end = (/** @type {number[]} */ all, /** @type {number} */ share) =>
		all[Math.round(share * (all.length - 1))];
	const [left, right, low, high] = [end(xs, 0.005), end(xs, 0.995), end(ys, 0.005), end(ys, 0.995)];
	const scale = Math.min(
		(width - 24) / Math.max(0.5, right - left),
		(height - 24) / Math.max(0.5, high - low),
	);
	for (const { id, points } of courses) {
		const way = points.map(([x, y]) => [
			width / 2 + (x - (left + right) / 2) * scale,
			height / 2 - (y - (low + high) / 2) * scale,
		]);
		g.globalAlpha = 0.6;
		stroke(trace(g, way), ink.id(id), 1);
		g.globalAlpha = 1;
		const [x, y] = way[way.length - 1];
		g.beginPath();
		g.arc(x, y, 3, 0, 7);
		g.fillStyle = ink.id(id);
		g.fill();
	}
}

/**
 * @param {HTMLElement} root
 * @param {object} on
 * @param {(run: Server.KeptRunInfo) => void} on.open
 * @param {(run: Server.KeptRunInfo) => void} on.pin
 * @param {(run: Server.KeptRunInfo, note: string) => void} on.note
 */
export function mountPreview(root, on) {
	/** @type {Server.Preview | null} */
	let told = null;
	const lanes = h("canvas", { role: "img" });
	const top = h("canvas", { role: "img", "aria-label": "Ways from above" });

	function draw() {
		if (!told || !lanes.isConnected) return;
		drawLanes(lanes, told);
		drawTop(top, told);
	}
	new ResizeObserver(draw).observe(root);

	return {
		draw,
		/** @param {Server.Preview | null} next  @param {string} [why] there is none */
		show(next, why = "") {
			told = next;
			if (!next) return fill(root, h("div", { class: "blank" }, h("p", {}, why)));
			const { run } = next;
			lanes.ariaLabel = `Lanes of run ${run.id}: ${many(next.tracks.length, "track")} over ${many(next.frames, "step")}`;
			const facts = [
				...run.changes.map((change) => [
					h("dt", { title: change.key }, symbol(change)),
					h("dd", {}, h("span", { class: "q" }, `${change.default} → `), change.value),
				]),
				...[
					["Missed", figure(run.misses, 0)],
					["False", figure(run.false_positives, 0)],
					["Identity switches", figure(run.id_switches, 0)],
					["Position error", run.position_error === null ? "–" : `${figure(run.position_error)} m`],
					["Seed", String(run.seed)],
					["Program", `${run.version}${run.older_code ? ", older code" : ""}`],
				].map(([word, value]) => [h("dt", {}, word), h("dd", {}, value)]),
			];
			const note = h("input", {
				class: "addnote",
				value: run.note,
				placeholder: "add a note",
				"aria-label": "Note",
				onchange: () => on.note(run, note.value),
			});
			fill(
				root,
				h(
					"div",
					{ class: "pane-head" },
					h("h2", { class: "pane-title" }, titleOf(run)),
					h(
						"span",
						{ class: "sub" },
						[
							when(run.began),
							many(run.targets, "track"),
							run.seconds ? `computed in ${run.seconds.toFixed(run.seconds < 9.5 ? 1 : 0)} s` : "",
						]
							.filter(Boolean)
							.join(" · "),
					),
					h("span", { class: "grow" }),
					h(
						"button",
						{ class: "btn main", "data-key": "Enter", onclick: () => on.open(run) },
						"Open in Tune",
					),
					h("button", { class: "btn box", onclick: () => on.pin(run) }, "Pin as A"),
				),
				h(
					"div",
					{ class: "pv-body" },
					h("div", { class: "pv-lanes" }, lanes),
					h("div", { class: "pv-top" }, top),
					h("dl", { class: "pv-facts" }, h("dt", {}, "Note"), h("dd", {}, note), facts.flat()),
				),
			);
			draw();
		},
	};
}
