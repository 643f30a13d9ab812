/**
 * In the timeline: numbered places in a row under the ruler, how it would be as ghosts in the lanes,
 * and pins and brackets where something was put right.
 */
import { faded, rule, stroke, trace } from "../draw/canvas.js";
import { fill, h, icon, one, write } from "../elements/dom.js";
import { xOf } from "../play/clock.js";
import { clockOf, middleOf } from "./words.js";

/** A number of one digit, and what each further digit adds to it, CSS pixels. */
const [NUMBER, DIGIT] = [17, 7];
/** Numbers that are written; those after them are a line. */
const MOST = 60;

/** How far from another a number is legible, CSS pixels. @param {HTMLElement} number */
const roomOf = ({ textContent }) => NUMBER + DIGIT * ((textContent?.length ?? 1) - 1);

/** @param {Context} context @param {TimelineSeam} timeline @param {Check} check */
export function mountMarks({ store }, timeline, check) {
	const { state } = check;
	const left = h("span.r");
	const label = h("div.gr.check", h("span", "to check"), left);
	one(".gut .ruler").after(label);
	const row = h("div.check-row", { role: "group", "aria-label": "Places to check" });
	timeline.plot.append(row);
	const tip = h("div.card.mark-card", { hidden: true });
	timeline.plot.append(tip);
	const legend = h("span", { "data-tip": "Corrected" }, icon("i-pin", "s"), "corrected");
	legend.hidden = true;
	one(".legend").append(legend);
	/** @type {HTMLElement[]} */
	let numbers = [];
	/** Pins as they were drawn last. @type {{x: number, y: number, told: Told}[]} */
	let pins = [];

	/** @param {Doubt} doubt @param {number} k */
	function number(doubt, k) {
		const { chosen } = state.get();
		return h(
			"button.qn",
			{
				tabindex: -1,
				"aria-label": `Place ${k + 1}: ${doubt.title}`,
				"aria-pressed": String(doubt.id === chosen?.id),
				title: doubt.title,
				onclick: () => check.choose(doubt),
			},
			k + 1,
		);
	}

	function list() {
		const doubts = state.get().queue?.doubts ?? [];
		write(left, doubts.length ? String(doubts.length) : "–");
		numbers = doubts.slice(0, MOST).map(number);
		fill(row, numbers);
		legend.hidden = !state.get().told?.corrections.some(({ met }) => met !== false);
		timeline.draw();
	}

	/**
	 * @param {Pen} pen  of the row under the ruler
	 * @param {Pen} lanes
	 * @param {{tracks: Server.TrackLife[], scroll: number}} how
	 */
	timeline.marks = (pen, lanes, { tracks, scroll }) => {
		const here = store.get().place === "check";
		row.hidden = !here;
		if (here) places(pen, lanes);
		drawOverLanes(lanes, tracks, scroll, here);
	};

	/** @param {Pen} pen @param {Pen} lanes */
	function places({ g, row: { y, height }, view, ink }, lanes) {
		const { queue, chosen, told } = state.get();
		const bottom = lanes.row.y + lanes.row.height;
		row.style.top = `${y}px`;
		/** The chosen one has its room, then the first in the queue. @type {number[]} */
		const taken = [];
		const shown = numbers.flatMap((element, k) => {
			const doubt = queue?.doubts[k];
			return doubt ? [{ element, doubt, wanted: doubt.id === chosen?.id }] : [];
		});
		for (const { element, doubt } of shown.sort((a, b) => Number(b.wanted) - Number(a.wanted))) {
			const x = xOf(middleOf(doubt), view);
			const free = taken.every((other) => Math.abs(other - x) > roomOf(element));
			element.hidden = x < 0 || x > view.width || !free;
			if (!element.hidden) taken.push(x);
			element.style.translate = `${Math.round(x)}px`;
		}
		g.fillStyle = faded(ink.get("warn"), 0.35);
		for (const doubt of queue?.doubts ?? []) {
			const [a, b] = [xOf(doubt.first, view), xOf(doubt.last + 1, view)];
			if (b < 0 || a > view.width) continue;
			const from = Math.max(0, a);
			g.fillRect(from, y + 2, Math.max(2, Math.min(view.width, b) - from), height - 4);
		}
		if (chosen) {
			const from = Math.max(0, xOf(chosen.first, view));
			const to = Math.min(view.width, xOf(chosen.last + 1, view));
			g.fillStyle = faded(ink.get("accent"), 0.16);
			if (to > from) g.fillRect(from, y, Math.max(2, to - from), bottom - y);
		}
		// What was looked at has a tick.
		for (const one of told?.corrections ?? []) {
			const x = xOf((one.first + one.last) / 2, view);
			if (x < 0 || x > view.width || taken.some((other) => Math.abs(other - x) < NUMBER)) continue;
			const middle = y + height / 2;
			stroke(
				trace(g, [
					[x - 4, middle],
					[x - 1, middle + 3],
					[x + 5, middle - 4],
				]),
				ink.get("ink-3"),
				1.5,
			);
		}
		for (const [first, last] of told?.checked ?? []) {
			const from = Math.max(0, xOf(first, view));
			const to = Math.min(view.width, xOf(last + 1, view));
			g.fillStyle = ink.get("good");
			if (to > from) g.fillRect(from, y + height - 2, to - from, 2);
		}
	}

	/**
	 * @param {Pen} pen @param {Server.TrackLife[]} tracks @param {number} scroll
	 * @param {boolean} here
	 */
	function drawOverLanes({ g, row: lanes, view, ink }, tracks, scroll, here) {
		const laneHeight = parseFloat(
			getComputedStyle(document.documentElement).getPropertyValue("--h-lane"),
		);
		const { told, preview } = state.get();
		g.save();
		g.beginPath();
		g.rect(0, lanes.y, view.width + 20, lanes.height);
		g.clip();
		const middles = new Map(
			tracks.map(({ id }, k) => [id, lanes.y + (k + 0.5) * laneHeight - scroll]),
		);
		// How it would be: the lane's new colour around it, over what is not so then.
		for (const { id, first, last, was } of (here && preview?.spans) || []) {
			const y = middles.get(was);
			const [a, b] = [
				Math.max(-4, xOf(first, view)),
				Math.min(view.width + 4, xOf(last + 1, view)),
			];
			if (y === undefined || b <= a) continue;
			const tall = laneHeight - 3;
			g.fillStyle = faded(ink.id(id), 0.4);
			g.fillRect(a, y - tall / 2, b - a, tall);
			g.beginPath();
			g.rect(a + 0.5, Math.round(y - tall / 2) + 0.5, b - a - 1, tall);
			stroke(g, ink.id(id), 1.5);
		}
		pins = [];
		for (const one of told?.corrections ?? []) {
			if (one.met === false || one.kind === "checked") continue;
			for (const id of new Set(one.tracks)) {
				const y = middles.get(id);
				if (y === undefined || one.last < view.first || one.first > view.last) continue;
				const x = xOf(one.first, view);
				drawPin(g, ink, x, Math.max(x + 4, xOf(one.last, view)), y);
				pins.push({ x, y, told: one });
			}
		}
		g.restore();
	}

	timeline.plot.addEventListener("pointermove", (event) => {
		const box = timeline.plot.getBoundingClientRect();
		const [x, y] = [event.clientX - box.left, event.clientY - box.top];
		const found = pins.find((pin) => Math.abs(pin.x - x) < 7 && Math.abs(pin.y - y) < 9);
		tip.hidden = !found;
		if (!found) return;
		fill(tip, h("b", found.told.words), ` · ${clockOf(found.told.time)}`);
		tip.style.translate = `${Math.round(Math.min(x + 12, box.width - tip.offsetWidth))}px ${Math.round(y - 26)}px`;
	});
	timeline.plot.addEventListener("pointerleave", () => (tip.hidden = true));
	// A press on a number is no seek.
	row.addEventListener("pointerdown", (event) => event.stopPropagation());

	function room() {
		const there = store.get().place === "check";
		document.documentElement.style.setProperty("--h-check", there ? "20px" : "0px");
		label.hidden = !there;
		dispatchEvent(new Event("panes"));
		timeline.draw();
	}
	state.watch(["queue", "chosen", "told"], list);
	state.on(["preview"], timeline.draw);
	store.watch(["place"], room);
}

/**
 * A pin where it was said, and a bracket under what it speaks of.
 * @param {Brush} g @param {Palette} ink @param {number} x @param {number} to @param {number} y
 */
function drawPin(g, ink, x, to, y) {
	const [a, b] = [Math.round(x) + 0.5, Math.round(to) + 0.5];
	stroke(
		trace(g, [
			[a, y + 3],
			[a, y + 5.5],
			[b, y + 5.5],
			[b, y + 3],
		]),
		ink.get("ink-1"),
		1.25,
	);
	rule(g, [a, y + 3], [a, y - 4], ink.get("bg-1"), 4);
	g.beginPath();
	g.arc(a, y - 4, 4, 0, 7);
	g.fillStyle = ink.get("bg-1");
	g.fill();
	rule(g, [a, y + 3], [a, y - 4], ink.get("ink-1"), 1.5);
	g.beginPath();
	g.arc(a, y - 4, 2.8, 0, 7);
	g.fillStyle = ink.get("ink-1");
	g.fill();
}
