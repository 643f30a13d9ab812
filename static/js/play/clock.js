/**
 * Arithmetic of the only clock, the step index, and of the axis it is drawn on.
 * Steps are 0-based and inclusive everywhere. Nothing here touches the page.
 */

/** Speeds that can be chosen, slowest first. */
export const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];

/** A whole step of the sequence, 0 for an empty one. @param {number} step @param {number} frames */
export const clampStep = (step, frames) => Math.max(0, Math.min(frames - 1, Math.round(step)));

/**
 * First and last step that are played.
 * @param {[number | null, number | null]} range  in and out points
 * @param {number} frames
 * @returns {[number, number]}
 */
export function playedRange([from, to], frames) {
	const first = clampStep(from ?? 0, frames);
	return [first, Math.max(first, clampStep(to ?? frames - 1, frames))];
}

/**
 * Where play stands after some time.
 *
 * At normal speed and below every step is shown: if painting is slower than the
 * clock, play slows down and nothing is skipped. Above, and where real time is wanted, steps may be
 * skipped.
 * @param {{step: number, rest: number}} now  `rest` is the part of a step already waited for
 * @param {number} seconds  since the last call
 * @param {{fps: number, speed: number, direction: 1 | -1, first: number, last: number, loop:
 * boolean, realTime?: boolean}} how
 * @returns {{step: number, rest: number, ended: boolean}}
 */
export function advance({ step, rest }, seconds, how) {
	const { fps, speed, direction, first, last, loop, realTime = false } = how;
	const due = rest + Math.max(0, seconds) * fps * speed;
	const whole = Math.floor(due + 1e-9);
	if (whole === 0) return { step, rest: due, ended: false };
	// Behind by more than a second, play does not jump: the page was asleep.
	const most = realTime ? Math.ceil(fps * speed) : speed <= 1 ? 1 : Math.ceil(speed * 2);
	const stride = Math.min(whole, Math.max(1, most));
	// Up to a step of lateness is caught up; more is forgotten: play is late, it does not race
	// afterwards.
	const left = Math.min(1, due - stride);
	const next = step + direction * stride;
	if (next >= first && next <= last) return { step: next, rest: left, ended: false };
	const [start, end] = direction > 0 ? [first, last] : [last, first];
	if (!loop) return { step: end, rest: 0, ended: true };
	return {
		step: step === end || step < first || step > last ? start : end,
		rest: left,
		ended: false,
	};
}

/**
 * How long the 3D view is to be left alone after it was told a step and after it drew, while it
 * plays: where the page comes too late to its own steps, 3D follows more rarely, and more often
 * again where there is time.
 * @param {number} wait  milliseconds, so far
 * @param {number} elapsed  milliseconds between two of the page's frames
 * @param {number} due  milliseconds a step
 */
export const restOf3d = (wait, elapsed, due) =>
	elapsed > 1.4 * due ? Math.min(1500, Math.max(400, wait * 1.5)) : wait < 40 ? 0 : wait * 0.985;

/**
 * How long the 3D view is to be left alone after a frame that held up the page: it takes a fifth of
 * the time at most, and still follows where there is hardly any.
 * @param {number} cost  milliseconds from the frame until the browser was ready for another
 */
export const restAfter3d = (cost) => Math.min(8000, 4 * Math.max(0, cost - 50));

/**
 * The steps to have ready, nearest first: the step itself, then ahead in the direction of
 * play, then a few behind.
 * @param {number} step
 * @param {{frames: number, fps: number, speed: number, direction: 0 | 1 | -1, most: number,
 * seconds?: number}} how `most` is what the memory holds
 */
export function prefetchWindow(step, { frames, fps, speed, direction, most, seconds = 1.5 }) {
	const stride = direction && speed > 1 ? Math.max(1, Math.floor((speed * fps) / 60)) : 1;
	const ahead = direction ? Math.ceil(Math.max(8, speed * fps * seconds) / stride) : 12;
	const behind = direction ? 0 : 6;
	const steps = [step];
	for (let k = 1; k <= Math.max(ahead, behind); k += 1) {
		if (k <= ahead) steps.push(step + (direction || 1) * k * stride);
		if (k <= behind) steps.push(step - (direction || 1) * k);
	}
	return steps.filter((k) => k >= 0 && k < frames).slice(0, Math.max(1, most));
}

/**
 * Neighbouring steps joined into ranges, ascending and inclusive.
 * @param {Iterable<number>} steps
 */
export function rangesOf(steps) {
	/** @type {[number, number][]} */
	const ranges = [];
	for (const step of [...steps].sort((a, b) => a - b)) {
		const last = ranges[ranges.length - 1];
		if (last && step <= last[1] + 1) last[1] = Math.max(last[1], step);
		else ranges.push([step, step]);
	}
	return ranges;
}

/**
 * CSS pixels from the left end of the axis.
 * @param {number} step  may lie between two steps
 * @param {View} view
 */
export const xOf = (step, { first, last, width }) =>
	last > first ? ((step - first) / (last - first)) * width : 0;

/**
 * Where a step is among values of which each stands for some steps.
 * @param {number} step
 * @param {Buckets} buckets
 */
export const bucketOf = (step, { first, stride }) => Math.floor((step - first) / stride);

/**
 * The whole step at CSS pixels from the left end, inside the view.
 * @param {number} x
 * @param {View} view
 */
export function stepAt(x, { first, last, width }) {
	const step = width > 0 ? first + (x / width) * (last - first) : first;
	return Math.round(Math.max(first, Math.min(last, step)));
}

/**
 * The view after zooming at CSS pixels x, which keep their step.
 * @param {View} view
 * @param {number} factor  below 1 shows fewer steps
 * @param {number} x
 * @param {number} frames
 */
export function zoomed(view, factor, x, frames) {
	const whole = Math.max(1, frames - 1);
	const span = Math.max(Math.min(20, whole), Math.min(whole, (view.last - view.first) * factor));
	const share = x / Math.max(1, view.width);
	const first = view.first + share * (view.last - view.first - span);
	return panned({ ...view, first, last: first + span }, 0, frames);
}

/**
 * The view moved by some steps, inside the sequence.
 * @param {View} view
 * @param {number} steps
 * @param {number} frames
 */
export function panned(view, steps, frames) {
	const span = view.last - view.first;
	const first = Math.max(0, Math.min(frames - 1 - span, view.first + steps));
	return { ...view, first, last: first + span };
}

/**
 * Distance of labelled and of small ticks: 1, 2 or 5 times a power of ten.
 * @param {View} view
 * @param {number} [pixels]  of two labels, at least
 */
export function tickSteps({ first, last, width }, pixels = 80) {
	const raw = Math.max(1, ((last - first) / Math.max(1, width)) * pixels);
	const power = 10 ** Math.floor(Math.log10(raw));
	const major = [1, 2, 5, 10].map((k) => k * power).find((k) => k >= raw - 1e-9) ?? 10 * power;
	return { major, minor: Math.max(1, major / (String(major)[0] === "2" ? 4 : 5)) };
}

/**
 * The labelled tick whose number a plate over the axis would cut, or null.
 * @param {View} view
 * @param {number} step  that the plate stands at
 * @param {number} reach  CSS pixels from the middle of the plate to its edge
 * @param {number} [digit]  CSS pixels across, of a digit at most
 */
export function tickUnder(view, step, reach, digit = 7) {
	const { major } = tickSteps(view);
	const tick = Math.round(step / major) * major;
	if (tick < view.first || tick > view.last) return null;
	const half = (String(tick).length * digit) / 2;
	// At both ends of the axis a number moves inward.
	const middle = Math.max(half, Math.min(view.width - half, xOf(tick, view)));
	const plate = Math.max(reach, xOf(step, view));
	return Math.abs(middle - plate) < reach + half ? tick : null;
}

/** Seconds with two decimals. @param {number} step @param {number} fps */
export const secondsOf = (step, fps) => (step / fps).toFixed(2);

/**
 * What a person typed: `264` is a step, `10.56 s` or `10,56s` a time, null neither.
 * @param {string} text
 * @param {number} fps
 * @param {number} frames
 */
export function parseStep(text, fps, frames) {
	const match = /^\s*(\d+(?:[.,]\d+)?)\s*(s?)\s*$/.exec(text);
	if (!match) return null;
	const number = Number(match[1].replace(",", "."));
	return clampStep(match[2] ? number * fps : number, frames);
}
