/** What was found out of an import: room, checks, target; each can be had otherwise. */
import { capital, h, icon, show } from "../elements/dom.js";
import { size } from "../library/words.js";
import { grow, heading, numberField, segment, select, small, wishing } from "./controls.js";
import { isMoved, isPictured, leaving, standing } from "./cameras.js";
import { planPicture } from "./plan.js";

/** @typedef {Server.ImportInfo} Info */
/** @typedef {[number, number, number]} Vector */

const AXES = ["x", "y", "z"];
const UPS = ["x", "y", "z", "-x", "-y", "-z"];
const LAYOUTS = ["ltwh", "xyxy", "yxyx", "cxcywh"];

/** Letters of a recording's folder; of a longer name the beginning is shown. */
const LONGEST_PLACE = 24;

/** Cameras whose pairs are listed one by one; those of more stand in a square. */
const MOST_LISTED = 6;
const MOST_WORST = 8;

/** @type {[keyof Server.ImportWish["methods"], string][]} */
const STAGES = [
	["single_view", "In each camera"],
	["fusion_method", "Fusion"],
	["smoothing_method", "Smoothing"],
];

const SIGNS = {
	good: ["tick", "good"],
	warning: ["warn", "warn"],
	absent: ["minus", "none"],
};

/** @param {string} words @param {string} note @param {string} [reason]  by the pointer */
const label = (words, note, reason) =>
	h("div.lab", { title: reason }, h("span", words), h("span", note));

/** Where a value is from, in a word, and the reason. @param {Info} info @param {"up" | "unit"} what @returns {[string, string?]} */
function origin({ wish, found }, what) {
	if (wish[what] !== null) return ["as you say"];
	const told = found.find(([name]) => name === what)?.[1];
	return told === undefined ? ["as the file says"] : ["found", told.split(";")[0]];
}

/* ---------- The room from above, its faces, and how the files are read. */

/** @param {Info} info @param {(room: Server.ImportWish["room"]) => void} moved  its faces */
export function roomPart(info, moved) {
	const { wish, room } = info;
	if (!room) return null;
	const words = AXES.map((axis, k) => `${axis} ${show(room[0][k])} to ${show(room[1][k])} m`);
	const from = wish.room ? "as you say" : "suggested where people were seen or views overlap";
	const keys = "Arrows move its near faces, with Shift the far ones";
	const isRead = [wish.pose, wish.axes, wish.boxes, wish.first_index].some((own) => own !== null);
	const face = (/** @type {number} */ end, /** @type {number} */ axis) =>
		numberField(
			`in-room-${end}-${axis}`,
			`Room, ${["from", "to"][end]} ${AXES[axis]}, metres`,
			room[end][axis],
			{
				room: room.map((corner, k) =>
					k === end ? corner.with(axis, /** @type {any} */ ("#")) : corner,
				),
			},
			{ step: 0.05 },
		);
	const side = h(
		"div.rf",
		h(
			"div",
			label("From, to", "metres"),
			h(
				"div.xyz",
				AXES.flatMap((letter, axis) => [h("span", letter), face(0, axis), face(1, axis)]),
			),
		),
		h("div", label("Up", ...origin(info, "up")), segment("Up", UPS, info.up, "up")),
		h(
			"div",
			label("File's unit", ...origin(info, "unit")),
			segment("Unit", ["mm", "cm", "m"], info.unit, "unit"),
		),
		label("How the files are read", isRead ? "as you say" : "found"),
		choice("Poses", "pose", wish.pose, info.pose, [
			"world-to-camera",
			"camera-to-world",
			"transposed",
			"position",
		]),
		choice("Axes", "axes", wish.axes, info.axes, ["opencv", "opengl"]),
		info.cameras.some(({ detections }) => detections) && [
			choice("Boxes", "boxes", wish.boxes, info.boxes, LAYOUTS),
			choice("First frame", "first_index", wish.first_index, info.first_index, ["0", "1"]),
		],
		anglesChoice(info),
		entrances(info),
		wish.room && wishing([icon("i-reset", "s"), "As suggested"], { room: null }),
	);
	return h(
		"section",
		{ "aria-label": "Room" },
		heading("Room", small(`${from}; drag its faces`)),
		h(
			"div.roomy",
			h(
				"div.from-above",
				planPicture(info, `Room from above, ${words.join(", ")}. ${keys}`, moved),
				h(
					"div.keyline.small",
					"Floor seen by",
					[1, 2, 3, 4].map((count) =>
						h("span", h("i", { class: `seen-${count}` }), count < 4 ? count : "4 +"),
					),
					"cameras",
				),
			),
			side,
		),
	);
}

/** Where people come in, as tracks of a first run show it; used where that is wished. @param {Info} info */
function entrances({ wish: { entrances: used }, entrances: found }) {
	if (used.length)
		return h("div.lab", `${used.length} entrances used`, wishing("Use none", { entrances: [] }));
	return (
		found.length > 0 &&
		h(
			"div.lab",
			{ title: "Where tracks of a first run begin and end" },
			"Entrances found",
			wishing(found.length === 1 ? "Use it" : `Use all ${found.length}`, { entrances: found }),
		)
	);
}

/** How rotations given by three angles are composed, where their names leave it open. @param {Info} info */
export const anglesChoice = ({ open_turns: open, wish, turns }) =>
	open.length > 1 && choice("Angles", "turns", wish.turns, turns, open);

/**
 * A choice among values, each with words of its own or called as it is. What was found out stands
 * first and holds until another is chosen.
 * @param {string} words @param {string} what @param {string | number | null} wished
 * @param {string} found  of the values @param {(string | [string, string])[]} values
 */
function choice(words, what, wished, found, values) {
	const named = values.map((one) =>
		typeof one === "string" ? /** @type {[string, string]} */ ([one, one]) : one,
	);
	const own = named.find(([value]) => value === found);
	const others = named.filter((one) => one !== own || wished !== null);
	/** @type {[string, string]} */
	const first = ["", wished === null && own ? own[1] : "as found"];
	return h(
		"label.lab",
		words,
		select(`in-${what}`, words, [first, ...others], String(wished ?? ""), {
			[what]: what === "first_index" ? "#" : "$",
		}),
	);
}

/* ---------- All checks, what is odd first; the pairs of cameras; the truth. */

/** @param {Info} info */
export function checksPart(info) {
	const { checks, under_way: now } = info;
	const of = (/** @type {Server.ImportedCheck["status"]} */ kind) =>
		checks.filter(({ status }) => status === kind);
	const { open, known, fine } = standing(info);
	return h(
		"section.in-scroll",
		{ tabindex: 0, "aria-label": "Checks" },
		heading(
			"Checks",
			small(now ? `looking at the ${now}…` : ""),
			grow(),
			small(`${fine} fine · ${open + known} to look at`),
		),
		h(
			"div.checks",
			undecided(info),
			exchanged(info),
			[...of("warning"), ...of("good"), ...of("absent")].map((one) => check(info, one)),
		),
		pairs(info),
	);
}

/** What has to be decided before anything is written, with a button for each way. @param {Info} info */
function undecided({ undecided: words, question, wish }) {
	if (!words) return null;
	if (!question)
		return line(
			"warning",
			"unexplained",
			words,
			wishing("Import it as it is", { ...wish, accept_best: true }),
		);
	return line(
		"warning",
		"open",
		question.difference,
		...question.wishes.map((own, k) =>
			wishing(capital(question.interpretations[k]), { ...own }, "box", {
				title: question.chosen[k],
			}),
		),
	);
}

/** Calibrations that are other cameras' than their names say, and the other choice. @param {Info} info */
function exchanged(info) {
	const { cameras, wish } = info;
	const kept = wish.as_named;
	const moved = cameras.filter(isMoved);
	if (moved.length === 0 && !kept) return null;
	return line(
		moved.length ? "warning" : "good",
		"calibrations",
		moved.length
			? `by the boxes ${moved.map(({ name, calibration_of: of }) => `${name} has that of ${of}`).join(", ")}`
			: "as the cameras are named",
		kept
			? wishing("As the boxes meet", { as_named: false })
			: wishing("As named", { as_named: true, swap: [] }),
	);
}

/** Checks whose name says all there is to say where nothing is odd. */
const SAY_ALL = [
	"people stand upright",
	"every camera agrees with another",
	"cameras above the floor",
	"cameras see the room",
];

/** @param {Info} info @param {Server.ImportedCheck} one */
const check = (info, { status, name, sentence, remedy, mend, cameras }) =>
	line(
		status,
		name,
		status === "good" && SAY_ALL.includes(name)
			? ""
			: remedy && !mend
				? `${sentence}: ${remedy}`
				: sentence,
		mend &&
			wishing("Apply", { ...mend }, "main", { title: remedy, "aria-label": `Apply ${remedy}` }),
		cameras.length > 0 && leaving(info, cameras),
	);

/** @param {Server.ImportedCheck["status"]} status @param {string} name @param {string} words @param {...Child} more */
function line(status, name, words, ...more) {
	const [sign, kind] = SIGNS[status];
	return h(
		"div.chk",
		icon(`i-${sign}`, kind),
		h("p", h("b", capital(name)), " ", words),
		h("div.answers", ...more),
	);
}

/** @param {Server.ImportedPair} pair @param {string} [sign] */
const pixels = ({ pixels: value }, sign = "") =>
	value === null ? "none" : `${value.toFixed(1)}${sign}`;

/** @param {Server.ImportedPair} pair */
const meeting = ({ share }) => `${(100 * share).toFixed(0)} % of their boxes meet`;

/** @param {Info} info */
function pairs({ pairs: found, cameras }) {
	if (!found.length) return null;
	if (cameras.length > MOST_LISTED) return grid(found, cameras);
	return h(
		"div.pairs",
		{
			role: "group",
			"aria-label": "How far boxes of two cameras miss each other",
		},
		found.map((pair) =>
			h(
				"span",
				{ class: pair.odd && "w", title: meeting(pair) },
				`${pair.first} – ${pair.second} `,
				h("b", pixels(pair, " px")),
			),
		),
	);
}

/** All pairs as a square, pixels without their sign, and the worst beside it. @param {Server.ImportedPair[]} found @param {Server.ImportedCamera[]} cameras */
function grid(found, cameras) {
	const of = (/** @type {string} */ one, /** @type {string} */ other) =>
		found.find(
			({ first, second }) =>
				(first === one && second === other) || (first === other && second === one),
		);
	const names = cameras.map(({ name }) => name);
	const worst = [...found].sort(
		(a, b) => Number(b.odd) - Number(a.odd) || (b.pixels ?? 0) - (a.pixels ?? 0),
	);
	return h(
		"div.pair-grid",
		h(
			"table",
			{ "aria-label": "How far boxes of two cameras miss each other, pixels" },
			h(
				"thead",
				h(
					"tr",
					h("td"),
					names.map((title, k) => h("th", { title }, k + 1)),
				),
			),
			h(
				"tbody",
				names.map((name, k) =>
					h(
						"tr",
						h("th", { scope: "row" }, `${k + 1} ${name}`),
						names.slice(0, k).map((other) => {
							const pair = of(name, other);
							const words = pair ? meeting(pair) : "nothing to compare";
							return h(
								"td",
								{ class: pair?.odd && "w", title: `${name} – ${other}: ${words}` },
								pair && pixels(pair),
							);
						}),
					),
				),
			),
		),
		h(
			"div",
			small("worst first"),
			h(
				"ol",
				worst
					.slice(0, MOST_WORST)
					.map((pair) =>
						h(
							"li",
							{ class: pair.odd && "w" },
							`${pair.first} – ${pair.second} `,
							h("b", pixels(pair, " px")),
						),
					),
			),
		),
	);
}

/* ---------- What is tracked, where the recording is kept, and what it is tracked with. */

/** @param {Info} info @param {Record<string, string[]>} methods  that there are */
export function targetPart(info, methods) {
	const { half_extents: half, suggested_half_extents: suggested, sizes } = info;
	if (!half || !suggested) return null;
	/** @type {[string, Vector, Vector | null][]} */
	const rows = [
		["Suggested", suggested, null],
		...Object.entries(sizes).map(
			([words, own]) => /** @type {[string, Vector, Vector]} */ ([words, own, own]),
		),
	];
	const pressed = rows.findIndex(([, own]) =>
		own.every((side, k) => Math.abs(side - half[k]) < 2e-3),
	);
	return h(
		"section.in-scroll",
		{ tabindex: 0, "aria-label": "Target and place" },
		heading("Target"),
		h(
			"div.choices",
			rows.map(([words, own, value], k) =>
				chosen(words, `${own.map((side) => (2 * side).toFixed(2)).join(" × ")} m`, k === pressed, {
					half_extents: value,
				}),
			),
			h(
				"div.choice.own",
				{ "aria-current": pressed < 0 && "true" },
				h("b", "Own size"),
				h(
					"span",
					["Width", "Depth", "Height"].map((words, axis) =>
						numberField(
							`in-size-${axis}`,
							`${words} of the target, metres`,
							2 * half[axis],
							{ half_extents: half.with(axis, /** @type {any} */ ("#")) },
							{ "data-scale": 0.5, step: 0.01, min: 0.02 },
						),
					),
				),
			),
		),
		heading("Kept"),
		kept(info),
		heading("Then track with"),
		h(
			"p",
			info.has_boxes
				? "By the boxes: no templates are needed."
				: "By what moves, until boxes are dragged on the pictures for colours.",
		),
		STAGES.map(([key, words]) => {
			const fits = info.fitting[key];
			return h(
				"label.lab",
				words,
				select(
					`in-${key}`,
					words,
					[
						["", fits ? `${fits} (fits)` : "as found"],
						...(methods[key] ?? []).map((one) => /** @type {const} */ ([one, one])),
					],
					info.wish.methods[key] ?? "",
					{ methods: { ...info.wish.methods, [key]: "$" } },
					info.unfit[key],
				),
			);
		}),
	);
}

/** @param {string} words @param {string} value @param {boolean} pressed @param {Record<string, unknown>} wish @param {string} [note] */
const chosen = (words, value, pressed, wish, note) =>
	h(
		"button.choice",
		{ "aria-pressed": String(pressed), "data-wish": JSON.stringify(wish) },
		h("b", words),
		h("span", value),
		note && small(note),
	);

/** @param {Info} info */
function kept(info) {
	const { uploaded, bytes, free, home, place: name } = info;
	const { copy_files: copies } = info.wish;
	const whole = `${home}/${name}`;
	const place = name.length > LONGEST_PLACE ? `${name.slice(0, LONGEST_PLACE)}…` : name;
	const there = `${size(free)} free there`;
	if (uploaded) return h("p", { title: whole }, `${size(bytes)} uploaded to ${place}, ${there}.`);
	// Boxes and truth are written anew: there is nothing to link.
	if (!isPictured(info)) return h("p", { title: whole }, `In ${place}, ${there}.`);
	return h(
		"div.choices",
		chosen("Link", "", !copies, { copy_files: false }, "The videos stay where they are."),
		chosen("Copy", size(bytes), copies, { copy_files: true }, `Into ${place}, ${there}.`),
	);
}
