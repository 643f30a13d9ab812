/** The sheet once files are there: cameras, room, checks, target, and what happens next. */
import { h, icon } from "../elements/dom.js";
import { many, size } from "../library/words.js";
import { camerasTable, isPictured, standing } from "./cameras.js";
import { CALIBRATIONS, button, close, cut, field, grow, numberField } from "./controls.js";
import { anglesChoice, checksPart, roomPart, targetPart } from "./settings.js";

/**
 * @param {Server.ImportInfo} info
 * @param {Record<string, string[]>} methods  that there are
 * @param {(room: Server.ImportWish["room"]) => void} moved  the room's faces
 */
export function draftSheet(info, methods, moved) {
	const asked = anglesChoice(info);
	return [
		head(info),
		...(info.cameras.length
			? [
					...camerasTable(info),
					h("div.in-body", roomPart(info, moved), checksPart(info), targetPart(info, methods)),
				]
			: [
					files(info),
					asked && h("div.in-asked", asked),
					!info.busy && ["failed", "settled"].includes(info.phase) && adding(),
				]),
		foot(info),
	];
}

/** What says how many steps a second has. @param {Server.ImportInfo} info */
function rateOrigin(info) {
	if (info.wish.fps !== null) return "as you say";
	const found = info.found.find(([name]) => name === "fps")?.[1];
	const why = found?.split(";")[0].split(", ").slice(1).join(", ");
	return why || (isPictured(info) ? "by the videos" : "by the files");
}

/** @param {Server.ImportInfo} info */
function head(info) {
	const { files_there, files_used, frames, cameras, fps, wish, phase } = info;
	const used = `${files_used} of ${many(files_there, "file")} used`;
	const facts = frames
		? `Hz, ${rateOrigin(info)} · ${many(cameras.length, "camera")} · ${many(frames, "step")} · ${(frames / fps).toFixed(1)} s · ${used}`
		: files_there
			? many(files_there, "file")
			: "";
	return h(
		"header.s-head",
		button(icon("i-prev"), "give-up", "icon start", { "aria-label": "Back to recent" }),
		h("h2", "Import"),
		field("in-name", "Name", wish.name, { name: "$" }, { maxlength: 80 }),
		frames > 0 &&
			numberField(
				"in-fps",
				"Rate, steps a second",
				fps,
				{ fps: "#" },
				{ min: 0.01, class: "rate" },
			),
		cut(facts, "sub"),
		grow(),
		!["uploading", "writing", "copying"].includes(phase) && button("Add files…", "files", ""),
		close(),
	);
}

/** @param {Server.ImportInfo} info */
const files = ({ files, coming }) =>
	h(
		"div.in-scroll.in-files",
		{ tabindex: 0 },
		files.map(({ label, why, format, read_with }) => {
			const short = why.startsWith(`${label}: `) ? why.slice(label.length + 2) : why;
			const words = short || (read_with ? `read with ${read_with}` : format);
			return h("p", h("b", label), ` ${words}`);
		}),
		coming.map((name) => h("p.coming", cut(name))),
	);

/** What may be missing where the files give no camera, and the way to add it. */
const adding = () =>
	h(
		"div.in-asked.in-add",
		icon("i-import", "l"),
		h("p", `Cameras need a calibration: ${CALIBRATIONS}. Drop what is missing, or`),
		button("Add a calibration file…", "files"),
	);

/** How far copying is. @param {Server.ImportInfo} info */
const copying = ({ copied, bytes, megabytes_per_second: speed }) =>
	copied ? `, ${size(copied)} of ${size(bytes)} copied, ${speed.toFixed(0)} MB/s` : "";

/** What there is to say now. @param {Server.ImportInfo} info @param {ReturnType<typeof standing>} now */
function stateOf(info, { ready, open, known }) {
	if (info.error) return info.error;
	switch (info.phase) {
		case "uploading":
			return "Uploading";
		case "reading":
			return info.under_way || "Reading the files";
		case "writing":
			return `Writing the recording${copying(info)}`;
		case "copying":
			return `It is open${copying(info)}; until then the files are links`;
	}
	// What is odd is not known yet while something is looked at.
	const things = info.busy
		? info.under_way
			? `looking at the ${info.under_way}`
			: "looking again"
		: open
			? `${many(open, "thing")} to decide${known ? `, ${known} more to look at` : ""}`
			: known
				? `nothing to decide, ${many(known, "thing")} to look at`
				: "nothing to decide";
	return `${ready} of ${many(info.cameras.length, "camera")} ready, ${things}. Nothing is written before you import.`;
}

/** @param {Server.ImportInfo} info */
function foot(info) {
	const { phase, busy, cameras, copied, bytes, received } = info;
	const now = standing(info);
	const kind = info.error
		? "bad"
		: busy || phase !== "settled"
			? "busy"
			: now.open || now.known
				? "warn"
				: "good";
	const words = stateOf(info, now);
	const uploads = phase === "uploading";
	const moving = uploads || (["writing", "copying"].includes(phase) && copied > 0);
	const part = Math.min(1, bytes ? (uploads ? received : copied) / bytes : 1);
	const pictured = cameras.every(({ video, detections }) => video || detections);
	const disabled = phase !== "settled" || !pictured || Boolean(info.undecided);
	const stops = ["uploading", "writing", "copying"].includes(phase);
	return h(
		"footer.s-foot",
		h("span", { class: `dot ${kind}` }),
		h(
			"span.bar",
			{
				role: "progressbar",
				"aria-label": uploads ? "Upload" : "Copy",
				"aria-valuemin": 0,
				"aria-valuemax": 100,
				"aria-valuenow": Math.round(100 * part),
				"--part": part.toFixed(4),
				hidden: !moving,
			},
			h("i"),
		),
		h("span.cut.say", { role: "status", title: words }, words),
		grow(),
		button(stops ? "Stop" : "Cancel", "give-up", "tall"),
		button("Only import", "import", "box tall", { disabled }),
		button(["Import and track", h("kbd", "Ctrl ↵")], "track", "main tall", { disabled }),
	);
}
