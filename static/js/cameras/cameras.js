/** The cameras: pictures and what is drawn over them, painted together. */
import { fill, h, icon, parts, write } from "../elements/dom.js";
import { prepare } from "../draw/canvas.js";
import { drawLoupe, drawPicture, lensOf } from "../draw/picture.js";
import { isRoomy, visibleTracks } from "../draw/overlay.js";
import { fillBoxCard, fillTrackCard } from "./cards.js";
import { createFloor } from "./floor.js";
import { decisionsOf, gateWords, isAlone, viewWords } from "../state/events.js";
import { mosaic } from "./mosaic.js";
import { pictureInk } from "../draw/colours.js";

/** A second click within this time makes it a double click, milliseconds. */
const DOUBLE_CLICK = 220;
/** Of the window's height, at most, where there is one camera and nothing to be beside it. */
const LONE = 0.4;

/** What the pictures leave of their column to the tables below, where notes make it low, CSS pixels. */
const LEFT_BELOW = 170;

/** @type {Pane} */
export function mountCameras(root, { store, actions, playback }) {
	const { mosaic: body, blank, nearest } = parts(root);
	/**
	 * @type {{element: HTMLElement, canvas: HTMLCanvasElement, name: HTMLElement, words: HTMLElement,
	 * absent: HTMLElement, card: HTMLElement}[]}
	 */
	let cells = [];
	/** @type {Cell[]} */
	let places = [];
	/** @type {Frame | null} */
	let frame = null;
	let sequenceKey = "";
	/** @type {Timer} */
	let clicked;
	/** Where the pointer is, in which cell.  @type {{index: number, x: number, y: number} | null} */
	let over = null;
	const cameras = () => store.get().cameras;
	const floor = createFloor(store, playback.repaint);

	function build() {
		sequenceKey = store.get().sequence?.key ?? "";
		frame = null;
		cells = cameras().map((camera, index) => {
			const canvas = h("canvas");
			const [name, words] = [h("b", {}, camera.name), h("span")];
			const absent = h("p", { class: "cam-absent", hidden: true });
			const card = h("div", { class: "card", hidden: true });
			const through = () => {
				clearTimeout(clicked);
				actions.lookThrough(index);
			};
			const element = h(
				"div",
				{
					class: "cam",
					tabindex: 0,
					role: "button",
					"aria-label": `Camera ${camera.name}`,
					onclick: (event) => {
						const id = hit(index, event)?.track?.id;
						// A finger does not hover: what it touches is told until it touches elsewhere.
						point(index, event);
						if (id !== undefined) (event.altKey ? actions.solo : actions.select)(id);
						else if (event.shiftKey) through();
						else if (event.detail < 2)
							clicked = setTimeout(() => actions.chooseCamera(index), DOUBLE_CLICK);
					},
					ondblclick: () => clearTimeout(clicked),
					onkeydown: (event) =>
						event.key === "Enter" && (event.shiftKey ? through() : actions.chooseCamera(index)),
					onpointerdown: (/** @type {PointerEvent} */ event) => point(index, event),
					onpointermove: (event) => point(index, event),
					onpointerleave: (/** @type {PointerEvent} */ { pointerType }) => {
						if (pointerType !== "touch") store.set({ hover: null, pointed: null });
						over = null;
						if (store.get().loupe) playback.repaint();
					},
				},
				canvas,
				absent,
				h("div", { class: "cam-tag" }, name, words),
				card,
			);
			return { element, canvas, name, words, absent, card };
		});
		fill(
			body,
			cells.map((cell) => cell.element),
		);
		arrange();
	}

	/** As high as the pictures need, or as the pane is where somebody made it so. */
	function arrange() {
		const { large, layout } = store.get();
		const own = Boolean(layout.cams || layout.max === "cams");
		root.classList.toggle("own", own);
		if (own) body.style.height = "";
		const usual = parseFloat(getComputedStyle(root).getPropertyValue("--h-cam")) * 1.1 + 8;
		const wanted = cameras().length === 1 ? Math.max(usual, LONE * innerHeight) : usual;
		const around = root.offsetHeight - body.offsetHeight;
		const fits = (root.parentElement?.clientHeight ?? Infinity) - around - LEFT_BELOW;
		const natural = Math.min(wanted, Math.max(usual / 2, fits));
		const { cells: found, height } = mosaic(
			cameras().map((c) => c.width / c.height),
			large,
			{ width: root.clientWidth, most: own ? body.clientHeight : natural, gap: 4, sparing: !own },
		);
		places = found;
		if (!own) body.style.height = `${height || Math.round(natural)}px`;
		const above = own ? Math.max(0, Math.round((body.clientHeight - height) / 2)) : 0;
		cells.forEach(({ element }, index) => {
			const { x, y, width, height } = places[index];
			Object.assign(element.style, {
				left: `${x}px`,
				top: `${y + above}px`,
				width: `${width}px`,
				height: `${height}px`,
			});
			element.ariaPressed = String(large === index);
		});
		if (frame) paint(frame);
	}

	/** @param {Frame} next */
	function paint(next) {
		frame = next;
		const { sequence, layers2d: layers, selection, hover, zooms, loupe, pointed } = store.get();
		if (sequence?.key !== sequenceKey) return;
		const ink = pictureInk();
		cells.forEach(({ element, canvas, words, absent }, index) => {
			// what is drawn says which step it is of, so that a test can hold them against each other
			element.dataset.step = String(next.step);
			element.dataset.overlay = String(next.result?.step ?? "");
			const { width, height } = places[index];
			const g = prepare(canvas, width, height);
			const view = next.result?.cameras[index];
			const what = {
				bitmap: next.pictures[index]?.bitmap,
				maps: next.maps[index] ?? [],
				faint: !isOwn(next, index),
				floor: floor.of(index),
				view,
			};
			/** @type {Scene} */
			const scene = {
				scale: width / cameras()[index].width,
				width,
				height,
				layers,
				selection,
				hover: hover?.id ?? null,
				pointed: pointed?.camera === index ? pointed.box : null,
				alone: isAlone(store.get()),
				names: store.get().names,
				people: next.result?.truth ?? [],
				fades: store.get().server?.trail.fades ?? true,
				opacity: next.stale ? 0.45 : 1,
				ink,
			};
			const lens = lensOf(followed(index, view) ?? zooms[index], width, height);
			drawPicture(g, what, scene, lens);
			if (loupe && over?.index === index) drawLoupe(g, what, scene, lens, over);
			write(words, wordsOf(next, index, isRoomy(width, height)));
			absent.hidden = !next.pictures[index]?.missing;
			write(absent, absent.hidden ? "" : `${cameras()[index].name}: no frame ${next.step}`);
			if (!store.get().playing) element.ariaLabel = sentenceOf(next, index);
		});
		nearest.hidden = next.pictures.every((one, index) => !one?.missing && isOwn(next, index));
		placeCards();
	}

	/** Whether a picture is of the step that is shown. @param {Pick<Frame, "step" | "pictures">} shown @param {number} index */
	const isOwn = ({ step, pictures }, index) => (pictures[index]?.of || step) === step;

	/**
	 * The magnification that keeps the selected track in the middle, where somebody wants that.
	 * @param {number} index @param {Server.CameraStep | undefined} view
	 * @returns {Magnified | null}
	 */
	function followed(index, view) {
		const { follow, selection, zooms } = store.get();
		const box = follow && view?.tracks.find(({ id, box }) => id === selection && box)?.box;
		if (!box) return null;
		const { width, height } = cameras()[index];
		const k = zooms[index]?.[0] ?? Math.max(1, Math.min(6, (0.45 * height) / box[3]));
		return [k, (box[0] + box[2] / 2) / width, (box[1] + box[3] / 2) / height];
	}

	/** How the picture is seen. @param {number} index */
	const lensNow = (index) =>
		lensOf(
			followed(index, frame?.result?.cameras[index]) ?? store.get().zooms[index],
			places[index].width,
			places[index].height,
		);

	/**
	 * What is drawn, for who does not see it.
	 * @param {Frame} shown @param {number} index
	 */
	function sentenceOf({ step, result }, index) {
		const view = result?.cameras[index];
		const ids = view ? visibleTracks(view).map(({ id }) => id) : [];
		const seen = !result?.computed
			? "not computed"
			: `${ids.length ? `tracks ${ids.join(", ")}` : "no track"}, ${view?.measurements.length} detections`;
		return `Camera ${cameras()[index].name}, step ${step}: ${seen}. Enter makes it large, Shift and Enter look through it in 3D`;
	}

	/**
	 * What a picture says of itself: what is missing, what is being computed, who is out of view.
	 * @param {Frame} shown
	 * @param {number} index
	 * @param {boolean} roomy
	 */
	function wordsOf({ pictures, result, step, stale }, index, roomy) {
		/** @type {string[]} */
		const words = [];
		if (!cameras()[index].has_pictures) roomy && words.push("boxes only, no pictures");
		else if (!pictures[index]?.bitmap)
			words.push(pictures[index] ? `no picture for step ${step}` : "picture not loaded");
		else if (!isOwn({ step, pictures }, index))
			words.push(`no frame ${step}, this is ${pictures[index]?.of}`);
		if (roomy && floor.words()) words.push(floor.words());
		const { follow, selection, layers2d } = store.get();
		const own = follow && result?.tracks.find(({ id }) => id === selection);
		if (roomy && own)
			words.push(`${own.id} ± ${own.sigma.map((v) => (100 * v).toFixed(0)).join(", ")} cm`);
		const view = result?.cameras[index];
		if (stale) words.push("computing");
		else if (result && !result.computed)
			words.push(store.get().run?.state === "computing" ? "computing" : "not computed");
		else if (view && roomy) {
			if (view.events.length) words.push(`2D: ${viewWords(view.events)}`);
			if (layers2d.samples) words.push(...gateWords(view.information));
			/** @type {Record<string, number[]>} */
			const away = {};
			for (const { id, visible, reason } of view.tracks)
				if (!visible) (away[reason ?? "out of view"] ??= []).push(id);
			for (const [why, ids] of Object.entries(away))
				words.push(`${ids.slice(0, 4).join(", ")}${ids.length > 4 ? " …" : ""} ${why}`);
		}
		return words.map((word) => ` · ${word}`).join("");
	}

	/**
	 * The track, else the detection, under the pointer.
	 * @param {number} index @param {MouseEvent} event
	 */
	function hit(index, { clientX, clientY }) {
		const view = frame && !frame.stale ? frame.result?.cameras[index] : undefined;
		if (!view) return null;
		const edge = cells[index].element.getBoundingClientRect();
		const { k, left, top } = lensNow(index);
		const scale = (places[index].width / cameras()[index].width) * k;
		const [x, y] = [(clientX - edge.left + left) / scale, (clientY - edge.top + top) / scale];
		const inside = (/** @type {Box} */ [left, top, width, height]) =>
			x >= left && x <= left + width && y >= top && y <= top + height;
		const { boxes, measurements } = store.get().layers2d;
		const track = boxes
			? visibleTracks(view)
					.reverse()
					.find(({ box }) => inside(box))
			: undefined;
		const box = measurements ? view.measurements.findIndex(({ box }) => inside(box)) : -1;
		return track ? { track } : box >= 0 ? { box } : null;
	}

	/** @param {number} index @param {MouseEvent} event */
	function point(index, event) {
		const found = hit(index, event);
		const edge = cells[index].element.getBoundingClientRect();
		over = { index, x: event.clientX - edge.left, y: event.clientY - edge.top };
		const { hover, pointed, loupe } = store.get();
		const id = found?.track?.id;
		const box = found?.box;
		if (hover?.id !== id || (hover && hover.camera !== index))
			store.set({ hover: id === undefined ? null : { id, camera: index } });
		if (pointed?.box !== box || (pointed && pointed.camera !== index))
			store.set({ pointed: box === undefined ? null : { camera: index, box } });
		if (loupe) playback.repaint();
	}

	/** The card stands left of its box, else right; never over it. */
	function placeCards() {
		const { hover, pointed, large } = store.get();
		cells.forEach(({ card }, index) => {
			// What is pointed at elsewhere is explained in the large picture.
			const here = hover && (hover.camera < 0 ? (large ?? 0) : hover.camera) === index;
			const view = frame?.result?.cameras[index];
			const track = here ? view?.tracks.find((t) => t.id === hover.id) : undefined;
			const lone =
				pointed?.camera === index && !track ? view?.measurements[pointed.box] : undefined;
			const box = track?.box ?? lone?.box;
			card.hidden = !box;
			if (!box) return;
			if (lone) fillBoxCard(card, lone, pointed?.box ?? 0);
			else if (track)
				fillTrackCard(
					card,
					track,
					frame?.result?.tracks.find(({ id }) => id === track.id),
					decisionsOf(store.get(), track.id, frame?.step ?? 0),
				);
			const { width, height, x } = places[index];
			const { k, left: gone, top } = lensNow(index);
			const scale = (width / cameras()[index].width) * k;
			const left = box[0] * scale - gone - card.offsetWidth - 8;
			const right = Math.min(
				(box[0] + box[2]) * scale - gone + 8,
				root.clientWidth - x - card.offsetWidth - 4,
			);
			const down = Math.min(box[1] * scale - top, height - card.offsetHeight - 28);
			card.style.left = `${Math.round(left + x >= 4 ? left : right)}px`;
			card.style.top = `${Math.round(Math.max(4, down))}px`;
		});
	}

	function header() {
		const { server, sequence, sequences } = store.get();
		blank.hidden = Boolean(sequence);
		if (sequence) return;
		const opening = server?.opening;
		const sample = opening ? undefined : sequences.find((entry) => entry.kind === "rendered");
		fill(
			blank,
			icon("i-folder", "l"),
			h("h3", {}, opening ? `Opening ${opening.name}` : "No sequence is open"),
			h(
				"p",
				{},
				opening ? "reading" : "Choose one at the top left: a built-in room needs no data.",
			),
			sample &&
				h(
					"button",
					{ class: "btn main", onclick: () => actions.open(sample.name) },
					`Open ${sample.name}`,
				),
		);
	}

	playback.onPaint(paint);
	build();
	store.on(["sequence"], ({ sequence }) => (sequence?.key ?? "") !== sequenceKey && build());
	store.watch(["server", "sequences"], header);
	store.on(["large"], arrange);
	store.on(
		["selection", "hover", "pointed", "layers2d", "layers3d", "zooms", "loupe", "follow", "names"],
		playback.repaint,
	);
	const observer = new ResizeObserver(arrange);
	for (const element of [root, root.parentElement]) element && observer.observe(element);
	addEventListener("panes", arrange);
}
