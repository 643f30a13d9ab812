/** The cameras of an import: a row each, with all that belongs to one and what is odd about it. */
import { plot } from "../elements/chart.js";
import { h, icon, one, show } from "../elements/dom.js";
import { drawnTable } from "../elements/drawn.js";
import { ownEnd } from "../library/words.js";
import { cut, field, numberField, select, small, wishing } from "./controls.js";

/** @typedef {Server.ImportInfo} Info */
/** @typedef {Server.ImportedCamera} Camera */

const HEADS = ["Camera", "Video", "Calibration", "Starts late by, frames", "Detections", "Ready"];

/** All rows, and what is not used, which stays in sight however many cameras there are. @param {Info} info */
export function camerasTable(info) {
	const rows = drawnTable(
		"Cameras",
		HEADS,
		info.cameras.map((camera, k) => row(info, camera, k)),
	);
	rows.className = isPictured(info) ? "cams-in" : "cams-in plain";
	const left = info.wish.left_out;
	const words = [
		...info.files
			.filter(({ why }) => why)
			.map(({ why, label }) => (why.startsWith(label) ? why : `${label}: ${why}`)),
		...info.told,
	].join(" · ");
	return [
		h(
			"div.cams-scroll",
			rows,
			left.length > 0 &&
				h("p.small.unused", `Left out: ${left.join(", ")}`, wishing("Put back", { left_out: [] })),
		),
		words && h("p.small.unused.told", { title: words, tabindex: 0 }, words),
	];
}

/** Whether nothing is to be decided about a camera. @param {Info} info @param {Camera} camera */
const isReady = (info, camera) =>
	!(
		camera.offset?.sure ||
		missesBoxes(info, camera) ||
		withoutSize(camera) ||
		isStray(info, camera)
	);

/** Whether a check says that it does not fit the others. @param {Info} info @param {Camera} camera */
const isStray = ({ checks }, { key }) => checks.some(({ cameras }) => cameras.includes(key));

/** A button that leaves cameras out. @param {Info} info @param {string[]} keys @param {string} [kind] */
export function leaving({ wish, cameras }, keys, kind) {
	const names = cameras.filter(({ key }) => keys.includes(key)).map(({ name }) => name);
	return wishing("Leave out", { left_out: [...wish.left_out, ...keys] }, kind, {
		"aria-label": `Leave out ${names.join(", ")}`,
	});
}

/**
 * What there is a button or a field for, to be decided; what is odd and only to be known; what is fine.
 * @param {Info} info
 */
export function standing(info) {
	const { cameras, checks, undecided } = info;
	const of = (/** @type {Server.ImportedCheck["status"]} */ kind) =>
		checks.filter(({ status }) => status === kind);
	const odd = of("warning");
	const open = odd.filter((one) => one.mend || one.cameras.length);
	const ready = cameras.filter((camera) => isReady(info, camera));
	return {
		ready: ready.length,
		open: Math.max(open.length + Number(Boolean(undecided)), cameras.length - ready.length),
		known: odd.length - open.length + Number(cameras.some(isMoved)),
		fine: of("good").length,
	};
}

/** Whether it has another one's calibration by what the boxes tell. @param {Camera} camera */
export const isMoved = ({ key, calibration_of: of }) => of !== key;

/** Whether any camera has pictures. @param {Info} info */
export const isPictured = ({ cameras }) => cameras.some(({ video }) => video);

/** @param {Info} info @param {Camera} camera */
const missesBoxes = ({ cameras }, { detections }) =>
	!detections && cameras.some((other) => other.detections);

/** Whether the way its boxes are read leaves none of them. @param {Camera} camera */
const withoutSize = ({ detections, boxes_per_step }) => Boolean(detections) && !boxes_per_step;

/** @param {string} first @param {string} second @param {string} [whole] */
const two = (first, second, whole = first) => [cut(first, "", whole), cut(second, "small")];

/** @param {Info} info @param {Camera} camera @param {number} k @returns {(Child | Child[])[]} */
function row(info, camera, k) {
	const { key, name, video, detections, frames, calibration_of: of } = camera;
	// The file is named for the browser, which shows an address that it has shown before as it was.
	const query = new URLSearchParams({ camera: key, of: video });
	return [
		h(
			"div.pic",
			isPictured(info) &&
				h(
					"span.shot",
					h("span.blank", icon("i-boxes")),
					video && h("img", { src: `/api/import/${info.key}/picture?${query}`, alt: "" }),
				),
			field(`in-name-${k}`, `Name of ${key}`, name, { names: { [key]: "$" } }, { maxlength: 60 }),
		),
		two(
			video || "no video",
			`${frames ? `${frames} frames · ${show(camera.fps)} fps · ` : ""}${camera.width} × ${camera.height}`,
		),
		two(
			short(info, "calibration", camera),
			[
				of !== key ? `that of ${of}` : key !== name && key,
				info.unit === "m" ? "in metres" : `${info.unit} → m`,
			]
				.filter(Boolean)
				.join(" · "),
			`${camera.calibration}: ${camera.calibration_format}`,
		),
		sync(info, camera, k),
		detections
			? two(
					short(info, "detections", camera),
					`${show(camera.boxes_per_step)} boxes a step · ${camera.boxes_format}`,
					detections,
				)
			: [
					h("span", { class: missesBoxes(info, camera) ? "missing" : "small" }, "none found"),
					small(video ? "a video only" : ""),
				],
		stateOf(info, camera, k),
	];
}

/** A camera's file without its folders, as far as cameras stay told apart. @param {Info} info @param {"calibration" | "detections"} what @param {Camera} camera */
function short({ cameras }, what, { [what]: label }) {
	const others = cameras.map((camera) => camera[what]).filter((other) => other !== label);
	return ownEnd(label, others) ?? label;
}

/** @param {Info} info @param {Camera} camera @param {number} k */
function sync(info, { key, name, seconds_late, offset }, k) {
	const { fps } = info;
	const late = Math.round(seconds_late * fps * 10) / 10;
	// From what the field has by now: two clicks are two frames, also before the first is answered.
	const step = (/** @type {string} */ sign, /** @type {number} */ by, /** @type {string} */ word) =>
		h(
			"button",
			{
				"aria-label": `${name}: a frame ${word}`,
				onclick(/** @type {any} */ { currentTarget }) {
					const input = one("input", currentTarget.parentElement);
					input.value = String(Math.round((Number(input.value) + by) * 10) / 10);
					input.dispatchEvent(new Event("change", { bubbles: true }));
				},
			},
			sign,
		);
	const words = offset
		? `Agreement over the offset, best ${(late + offset.steps).toFixed(1)} frames late`
		: "Nothing to compare";
	return h(
		"div.sync",
		h(
			"span.stepper",
			step("−", -1, "less"),
			numberField(
				`in-late-${k}`,
				`${name} starts late by, frames`,
				late,
				{ offsets: { [key]: "#" } },
				{ "data-scale": -1 / fps },
				Number.isInteger(late) ? 0 : 1,
			),
			step("+", 1, "more"),
		),
		curve(offset, late, words),
	);
}

/** @param {string} words @param {...(Child)} buttons */
const fault = (words, ...buttons) =>
	h("div.fault", icon("i-warn", "s"), h("span", words), h("span.group", ...buttons));

/** @param {Info} info @param {Camera} camera @param {number} k */
function stateOf(info, camera, k) {
	const { offset, key, name } = camera;
	const { wish, fps, offered } = info;
	if (offset?.sure) {
		const late = camera.seconds_late * fps + offset.steps;
		const whole = Math.abs(late).toFixed(0);
		return fault(
			`starts ${whole} frames ${late > 0 ? "late" : "early"}`,
			wishing(`Apply ${late < 0 ? "−" : ""}${whole}`, {
				offsets: { [key]: -late / fps },
			}),
		);
	}
	if (withoutSize(camera))
		return fault(
			"none of its boxes is left as they are read",
			(wish.boxes || wish.first_index !== null) &&
				wishing("As found", { boxes: null, normalised: null, first_index: null }),
		);
	if (missesBoxes(info, camera))
		return fault(
			"without boxes it cannot help",
			offered.length > 0 &&
				select(
					`in-boxes-${k}`,
					`Boxes of ${name}`,
					[["", "Choose…"], ...offered.map((one) => /** @type {const} */ ([one, one]))],
					"",
					{ files: [...wish.files, [key, "$"]] },
				),
			leaving(info, [key], ""),
		);
	if (isStray(info, camera)) return fault("does not fit the others", leaving(info, [key], ""));
	return h("span.okay", icon("i-tick"), "ready");
}

/* ---------- How well a camera agrees with the others when it is shifted. */

/** Of a curve, CSS pixels. */
const [WIDTH, HEIGHT] = [140, 42];

/** Frames on either side that a curve shows at least. */
const REACH = 30;

/**
 * @param {Server.ImportedOffset | null} found  beyond what it is shifted by
 * @param {number} late  frames, that it is shifted by
 * @param {string} words  what the picture says
 */
const curve = (found, late, words) =>
	h(
		"div.curve",
		{ role: "img", "aria-label": words },
		found ? plot(agreement(found, late), WIDTH, HEIGHT).element : "nothing to compare",
	);

/** @param {Server.ImportedOffset} found @param {number} late */
function agreement({ steps, offsets, agreement, sure }, late) {
	const reach = Math.max(REACH, Math.ceil(Math.abs(steps) + 5));
	const points = offsets.flatMap((x, k) => {
		const y = agreement[k];
		return y !== null && Math.abs(x) <= reach ? [{ x, y }] : [];
	});
	const values = points.map(({ y }) => y);
	const [low, high] = values.length ? [Math.min(...values), Math.max(...values)] : [0, 1];
	const close = sure && Math.abs(steps) < reach / 4; // their numbers would lie over each other
	const labelled = [-reach, reach, ...(close ? [] : [0]), ...(sure ? [steps] : [])];
	/** @type {import("../elements/chart.js").Mark[]} */
	const marks = [
		{ kind: "line", colour: "ink-3", points: [-reach, reach].map((x) => ({ x, y: low })) },
		{ kind: "line", colour: "ink-3", points: [low, high].map((y) => ({ x: 0, y })) },
		{ kind: "line", colour: sure ? "warn" : "ink-2", size: 1.5, points },
		{ kind: "dots", colour: "warn", points: sure ? [{ x: steps, y: high }] : [] },
	];
	return {
		x: {
			ends: [-reach, reach],
			ticks: labelled.map(
				(by) => /** @type {const} */ ([by, (late + by).toFixed(0).replace("-", "−")]),
			),
		},
		y: { ends: [low, high], ticks: [] },
		marks,
		margin: [10, 4, 10, 17],
	};
}
