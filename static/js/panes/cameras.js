// @ts-check
/** The cameras: pictures and what is drawn over them, painted together. */
import { fill, h, icon, idTag, show, tipOf, write } from "../dom.js";
import { prepare } from "../draw/canvas.js";
import { drawEmptyPicture, drawOverlay, visibleTracks } from "../draw/overlay.js";
import { viewWords } from "../events.js";
import { mosaic } from "../mosaic.js";
import { pictureInk } from "../palette.js";

/** @type {[string, string, string, string][]} layer, word, sign, command */
const LAYERS = [
	["measurements", "detections", "l-thin", "detections"],
	["estimates", "2D estimates", "l-corner", "estimates"],
	["boxes", "boxes", "l-thick", "boxes"],
	["samples", "samples", "l-dots", "samples"],
	["truth", "truth", "l-dash", "truth"],
];

/** @param {HTMLElement} root @param {Context} context */
export function mountCameras(root, { store, page, actions, playback }) {
	/** @type {Record<string, HTMLButtonElement>} */
	const chips = {};
	for (const [layer, word, sign, command] of LAYERS) {
		chips[layer] = h(
			"button",
			{ class: "chip end", ...tipOf(command), onclick: () => page.toggleLayer2d(layer) },
			icon(sign, "", "0 0 14 10"),
			h("span", {}, word),
		);
	}
	const body = h("div", { class: "mosaic" });
	const blank = h("div", { class: "blank", hidden: true });
	root.append(
		h(
			"div",
			{ class: "pane-head" },
			h("h2", { class: "pane-title" }, "Cameras"),
			h("span", { class: "grow" }),
			h("div", { class: "chips", role: "group", "aria-label": "Layers in the pictures" }, Object.values(chips)),
		),
		body,
	);

	/** @type {{element: HTMLElement, canvas: HTMLCanvasElement, tag: HTMLElement, card: HTMLElement}[]} */
	let cells = [];
	/** @type {Cell[]} */
	let places = [];
	/** @type {Frame | null} */
	let frame = null;
	let sequenceKey = "";

	function build() {
		const sequence = store.get().server?.sequence;
		sequenceKey = sequence?.key ?? "";
		frame = null;
		cells = (sequence?.cameras ?? []).map((camera, index) => {
			const canvas = h("canvas", { role: "img", "aria-label": `Picture of ${camera.name}` });
			const tag = h("div", { class: "cam-tag" }, h("b", {}), h("span", {}));
			const card = h("div", { class: "card", hidden: true });
			const element = h("div", {
				class: "cam",
				tabindex: 0,
				role: "button",
				"aria-label": `Camera ${camera.name}: make large`,
				onclick: () => {
					const id = store.get().hover?.id;
					if (id !== undefined) page.select(id);
					else actions.chooseCamera(index);
				},
				onkeydown: (/** @type {KeyboardEvent} */ event) => {
					if (event.key === "Enter") actions.chooseCamera(index);
				},
				onpointermove: (/** @type {PointerEvent} */ event) => point(index, event),
				onpointerleave: () => store.set({ hover: null }),
			});
			element.append(canvas, tag, card);
			write(tag.children[0], camera.name);
			return { element, canvas, tag, card };
		});
		fill(body, cells.map((cell) => cell.element), blank);
		arrange();
	}

	function arrange() {
		const { server, large } = store.get();
		const cameras = server?.sequence?.cameras ?? [];
		const style = getComputedStyle(document.documentElement);
		const most = parseFloat(style.getPropertyValue("--h-cam")) * 1.1 + 8;
		const layout = mosaic(cameras.map((c) => c.width / c.height), large, { width: root.clientWidth, most, gap: 4 });
		places = layout.cells;
		body.style.height = `${layout.height || Math.round(most)}px`;
		cells.forEach(({ element }, index) => {
			const { x, y, width, height } = places[index];
			Object.assign(element.style, { left: `${x}px`, top: `${y}px`, width: `${width}px`, height: `${height}px` });
			element.setAttribute("aria-pressed", String(large === index));
		});
		if (frame) paint(frame);
	}

	/** @param {Frame} next */
	function paint(next) {
		frame = next;
		const state = store.get();
		const cameras = state.server?.sequence?.cameras ?? [];
		if (state.server?.sequence?.key !== sequenceKey) return;
		const ink = pictureInk();
		cells.forEach(({ element, canvas, tag }, index) => {
			// what is drawn says which step it is of, so that a test can hold them against each other
			element.dataset.step = String(next.step);
			element.dataset.overlay = String(next.result?.step ?? "");
			const { width, height } = places[index];
			const camera = cameras[index];
			const g = prepare(canvas, width, height);
			const picture = next.pictures[index];
			const view = next.result?.cameras[index];
			if (picture?.bitmap) {
				g.imageSmoothingQuality = "medium";
				g.drawImage(picture.bitmap, 0, 0, width, height);
			} else drawEmptyPicture(g, width, height);
			if (view) {
				drawOverlay(g, view, {
					scale: width / camera.width,
					width,
					height,
					layers: state.layers2d,
					selection: state.selection,
					hover: state.hover?.id ?? null,
					opacity: next.stale ? 0.45 : 1,
					ink,
				});
			}
			write(tag.children[1], tagText(next, index, width > 260));
		});
		placeCard();
	}

	/**
	 * What a picture says of itself: what is missing, what is being computed, who is out of view.
	 * @param {Frame} shown
	 * @param {number} index
	 * @param {boolean} roomy
	 */
	function tagText(shown, index, roomy) {
		const state = store.get();
		const camera = state.server?.sequence?.cameras[index];
		const view = shown.result?.cameras[index];
		/** @type {string[]} */
		const words = [];
		const picture = shown.pictures[index];
		if (camera?.has_pictures && !picture?.bitmap) {
			words.push(picture ? `no picture for step ${shown.step}` : "picture not loaded");
		} else if (!camera?.has_pictures && roomy) words.push("boxes only, no pictures");
		if (shown.stale) words.push("computing");
		else if (shown.result && !shown.result.computed) words.push(state.run?.state === "computing" ? "computing" : "not computed");
		else if (view) {
			if (view.events.length) words.push(`2D: ${viewWords(view.events)}`);
			const away = view.tracks.filter((track) => !track.visible);
			/** @type {Map<string, number[]>} */
			const reasons = new Map();
			for (const { id, reason } of away) {
				const why = reason ?? "out of view";
				reasons.set(why, [...(reasons.get(why) ?? []), id]);
			}
			for (const [why, ids] of reasons) words.push(`${ids.slice(0, 4).join(", ")}${ids.length > 4 ? " …" : ""} ${why}`);
		}
		return words.length ? ` · ${words.join(" · ")}` : "";
	}

	/** @param {number} index @param {PointerEvent} event */
	function point(index, event) {
		const view = frame && !frame.stale ? frame.result?.cameras[index] : undefined;
		const camera = store.get().server?.sequence?.cameras[index];
		if (!view || !camera || !store.get().layers2d.boxes) return;
		const scale = places[index].width / camera.width;
		const x = event.offsetX / scale;
		const y = event.offsetY / scale;
		const near = visibleTracks(view).filter(({ box: [l, t, w, hgt] }) => x >= l && x <= l + w && y >= t && y <= t + hgt);
		const id = near[near.length - 1]?.id;
		const before = store.get().hover;
		if (before?.id !== id || (before && before.camera !== index)) {
			store.set({ hover: id === undefined ? null : { id, camera: index } });
		}
	}

	/** The card stands left of its box, else right; never over it, and only in roomy pictures. */
	function placeCard() {
		const { hover, server } = store.get();
		cells.forEach(({ card }, index) => {
			const view = frame?.result?.cameras[index];
			const track = hover?.camera === index ? view?.tracks.find((t) => t.id === hover.id) : undefined;
			const camera = server?.sequence?.cameras[index];
			card.hidden = !track?.box || !view || !camera || places[index].width <= 260;
			if (card.hidden || !track?.box || !view || !camera) return;
			fillCard(card, track);
			const { width, height } = places[index];
			const scale = width / camera.width;
			const left = track.box[0] * scale - card.offsetWidth - 8;
			const right = (track.box[0] + track.box[2]) * scale + 8;
			card.style.left = `${Math.round(left >= 4 ? left : Math.min(right, width - card.offsetWidth + 120))}px`;
			card.style.top = `${Math.round(Math.max(4, Math.min(track.box[1] * scale, height - card.offsetHeight - 28)))}px`;
		});
	}

	/** @param {HTMLElement} card @param {TrackInView} track */
	function fillCard(card, track) {
		const whole = frame?.result?.tracks.find((t) => t.id === track.id);
		fill(
			card,
			h("h3", {}, idTag(track.id), track.seen ? "seen" : "coasting"),
			h(
				"dl",
				{},
				whole && [h("dt", {}, "existence"), h("dd", {}, whole.existence.toFixed(2))],
				track.detection_probability !== null && [
					h("dt", {}, h("i", {}, "p"), h("sub", {}, "D")),
					h("dd", {}, show(Number(track.detection_probability.toFixed(3))), track.hidden_by !== null && h("small", {}, ` hidden by ${track.hidden_by}`)),
				],
				[h("dt", {}, "fed by"), h("dd", {}, track.seen ? `box ${(track.source ?? 0) + 1}` : "no box here")],
				whole && [h("dt", {}, "at"), h("dd", {}, whole.position.map((v) => v.toFixed(2).replace("-", "−")).join("  "), h("small", {}, " m"))],
			),
		);
	}

	function header() {
		const { server, layers2d } = store.get();
		const sequence = server?.sequence;
		for (const [layer] of LAYERS) chips[layer].setAttribute("aria-pressed", String(Boolean(layers2d[layer])));
		chips.truth.toggleAttribute("disabled", !sequence?.has_truth);
		chips.samples.toggleAttribute("disabled", server?.methods.single_view === "none");
		write(chips.measurements.children[1], server?.methods.single_view === "none" ? "detections" : "peaks");
		blank.hidden = Boolean(sequence);
		if (!sequence) {
			const opening = server?.opening;
			const [title, text] = opening
				? [`Opening ${opening.name}`, opening.total ? `${opening.message}, ${opening.done} of ${opening.total}` : opening.message]
				: ["No sequence is open", "Choose one at the top left: a rendered room needs no data."];
			const part = opening?.total ? opening.done / opening.total : 0;
			const sample = opening ? undefined : store.get().sequences.find((entry) => entry.kind === "rendered");
			fill(
				blank,
				icon("i-folder", "l"),
				h("h3", {}, title),
				opening && h("span", { class: "bar", "--part": part }, h("i", {})),
				h("p", {}, text),
				sample && h("button", { class: "btn main", onclick: () => page.open(sample.name) }, `Open ${sample.name}`),
			);
		}
	}

	playback.onPaint(paint);
	build();
	store.on(["server"], (state) => {
		if ((state.server?.sequence?.key ?? "") !== sequenceKey) build();
		header();
	});
	store.on(["sequences"], header);
	store.on(["layers2d"], () => {
		header();
		playback.repaint();
	});
	store.on(["large"], arrange);
	store.on(["selection", "hover"], playback.repaint);
	new ResizeObserver(arrange).observe(root);
	addEventListener("resize", arrange);
	header();
}
