/** The sheet before anything was dropped: files, what was open last, the built-in rooms. */
import { h, icon, show } from "../elements/dom.js";
import { many, size, when } from "../library/words.js";
import { CALIBRATIONS, button, close, grow, heading, small } from "./controls.js";

const UNDERSTOOD = [
	["Video", "mp4, mov, avi, mkv; folders of numbered pictures"],
	["Calibration", CALIBRATIONS],
	[
		"Detections",
		"MOTChallenge, YOLO, COCO, OpenPose, CVAT, LabelMe, VIA, JSON, CSV; none is fine too",
	],
];

/** What stands there before the list of recordings is. */
export const startHead = () => [
	h(
		"header.s-head",
		h("h2", "Open a recording"),
		grow(),
		h("input", {
			id: "open-find",
			type: "search",
			placeholder: "find by name",
			"aria-label": "Find by name",
		}),
		close(),
	),
];

/** @param {Server.Recordings} known */
export function startSheet(known) {
	const { recordings } = known;
	return [
		...startHead(),
		h(
			"div.open-body",
			files(known),
			h(
				"section.open-list",
				{ "aria-label": "Recordings" },
				...cards(
					"Recent",
					"what you open is found here again",
					recordings.filter(({ kind }) => kind !== "rendered"),
					grow(),
					button("All in the library", "library", ""),
				),
				...cards(
					"Built-in rooms",
					"they come with the program, with truth",
					recordings.filter(({ kind }) => kind === "rendered"),
				),
			),
		),
	];
}

/** @param {Server.Recordings} known */
const files = ({ most, free, folders }) =>
	h(
		"section.open-files",
		{ "aria-label": "Files" },
		h(
			"div.dropzone",
			icon("i-import", "l"),
			h("b", "Drop files or a folder"),
			h(
				"p",
				"Videos or picture folders, a calibration, detections: whatever there is. ",
				`At most ${Math.floor(most / 2 ** 30)} GB; ${size(free)} are free.`,
			),
			h("span.group", button("Choose files…", "files"), button("Choose folder…", "folder")),
		),
		h("label.small", { for: "open-path" }, "or a path on the machine that runs the workbench"),
		h(
			"form.pathline",
			h("input", {
				id: "open-path",
				type: "text",
				placeholder: "folder or sequence.toml",
				"aria-label": "Path",
				list: "open-folders",
				autocomplete: "off",
			}),
			h(
				"datalist",
				{ id: "open-folders" },
				folders.map((value) => h("option", { value })),
			),
			button("Open", "path"),
		),
		h(
			"dl.known",
			UNDERSTOOD.flatMap(([word, text]) => [h("dt", word), h("dd", text)]),
		),
	);

/**
 * @param {string} words @param {string} note  of the rooms always, else where there is none
 * @param {Server.RecordingCard[]} recordings @param {...HTMLElement} beside
 */
function cards(words, note, recordings, ...beside) {
	const names = recordings.map(({ name }) => name);
	const told = recordings.length && recordings[0].kind !== "rendered" ? "" : note;
	return [
		heading(words, small(told), ...beside),
		h(
			"div.cards",
			recordings.map((one) => card(one, names.indexOf(one.name) === names.lastIndexOf(one.name))),
		),
	];
}

/** What cannot be shown leaves the sign under it in sight. @param {Event} event */
const away = ({ currentTarget }) => /** @type {Element} */ (currentTarget).remove();

/** @param {Server.RecordingCard} recording @param {boolean} named  its name is enough; else its folder is told */
function card(recording, named) {
	const { name, opens, description, cameras, frames, fps, opened, picture } = recording;
	const length = fps
		? `${show(fps)} Hz · ${lasting(frames / fps)}`
		: description.replace(/^rendered room: /, "") || (frames ? `${frames} steps` : "");
	return h(
		"button.rec",
		{
			title: `${name}: ${description || length}${named ? "" : `, ${opens}`}`,
			"data-do": "recording",
			"data-value": opens,
			"aria-current": recording.open && "true",
		},
		h(
			"span.shot",
			// Under its picture; what was opened and has none has boxes alone.
			h("span.blank", icon(opened ? "i-boxes" : "i-folder", "l")),
			picture && h("img", { src: picture, alt: "", loading: "lazy", onerror: away }),
			small(many(cameras, "camera"), { class: "small lens" }),
		),
		h("b.cut", name),
		!named && small(`…/${opens.split(/[\\/]/).filter(Boolean).slice(-2).join("/")}`),
		h(
			"span.small",
			h("span.cut", length),
			h("span", recording.open ? "open now" : opened > 0 && when(opened)),
		),
	);
}

/** @param {number} seconds */
function lasting(seconds) {
	const whole = Math.round(seconds);
	return whole < 60 ? `${seconds.toFixed(1)} s` : `${Math.floor(whole / 60)} min ${whole % 60} s`;
}
