/**
 * The cameras: where each picture goes, how closely it is seen, what is drawn over it, painted
 * together, and the cards beside its boxes.
 */
import { prepare, pictureInk } from "../draw/canvas.js";
import {
	drawLoupe,
	drawPicture,
	lensOf,
	isRoomy,
	visibleTracks,
	createFloor,
} from "../draw/overlay.js";
import { capture, fill, h, icon, parts, write, idTag, show } from "../elements/dom.js";
import { decisionsOf, gateWords, isAlone, viewWords } from "../state/events.js";

/* ---------- Cards beside the boxes of a picture: what a track is made of, and whose a box is. */

/** @param {Child | Child[]} word @param {Child[]} value */
const row = (word, ...value) => [h("dt", word), h("dd", ...value)];

/** @param {number} number @param {string} text */
const about = (number, text) => [show(Number(number.toFixed(2))), h("small", text)];

/**
 * @param {HTMLElement} card
 * @param {Server.CameraTrack} track
 * @param {Server.Track | undefined} whole
 * @param {Server.Decided[]} decisions  what smoothing made otherwise of it, the nearest first
 */
function fillTrackCard(card, track, whole, decisions) {
	const {
		id,
		seen,
		detection_probability: p,
		hidden_by: front,
		reason,
		source,
		fed_by: fed,
	} = track;
	fill(
		card,
		h("h3", idTag(id), seen ? "seen" : "coasting"),
		h(
			"dl",
			whole && row("existence", whole.existence.toFixed(2)),
			p !== null &&
				row(
					[h("i", "p"), h("sub", "D")],
					show(Number(p.toFixed(3))),
					h("small", front !== null ? ` hidden by ${front}` : reason ? ` ${reason}` : ""),
				),
			row(
				"fed by",
				...(seen && fed
					? [
							`box ${source + 1}`,
							h(
								"small",
								`, ${Math.round(100 * fed.share)} % sure, score ${show(Number(fed.weight.toPrecision(2)))}`,
							),
						]
					: ["no box here"]),
			),
			whole &&
				row(
					"at",
					whole.position.map((v) => v.toFixed(2).replace("-", "−")).join("  "),
					h("small", " m"),
				),
			whole && row("±", whole.sigma.map((v) => v.toFixed(2)).join("  "), h("small", " m")),
			whole?.height &&
				row(
					"height",
					whole.height[0].toFixed(2),
					h("small", ` ± ${whole.height[1].toFixed(2)} m, standing`),
				),
		),
		decisions.slice(0, 2).map(({ words }) => h("p.decision", words)),
	);
}

/**
 * A box that the camera's filter was given.
 * @param {HTMLElement} card
 * @param {Server.Measurement} measurement
 * @param {number} index
 */
function fillBoxCard(card, { score, track, nearest, sigmas, gate }, index) {
	const beyond = sigmas !== null && gate !== null ? sigmas - gate : 0;
	fill(
		card,
		h("h3", `box ${index + 1}`, h("small", track === null ? " nobody's" : " feeds")),
		h(
			"dl",
			row("score", ...about(score, "")),
			track !== null && row("track", idTag(track)),
			track === null &&
				(nearest === null || sigmas === null
					? row("nearest", "no track in this picture")
					: row("nearest track", idTag(nearest), " ", ...about(sigmas, " σ away"))),
			track === null &&
				gate !== null &&
				row(
					"gate",
					...about(gate, beyond > 0 ? ` σ: ${show(Number(beyond.toFixed(2)))} σ outside` : " σ"),
				),
		),
	);
}

/* ---------- Where the camera pictures go: one large and the others in a column beside it, or
   all alike. Every picture keeps its own shape. */

/**
 * @param {number[]} aspects  width by height of each camera
 * @param {number | null} large  index of the large one; null for all alike
 * @param {{width: number, most: number, gap: number, sparing?: boolean}} room  `most` is the height
 * that may be used; sparing: what is not used of it is wanted elsewhere
 * @returns {{cells: Cell[], height: number}} cells relative to the mosaic, its height with the gaps
 * around
 */
export function mosaic(aspects, large, { width, most, gap, sparing }) {
	if (aspects.length === 0) return { cells: [], height: 0 };
	const inner = Math.max(1, width - 2 * gap);
	const tall = Math.max(1, most - 2 * gap);
	return large === null || aspects.length === 1 || large >= aspects.length
		? alike(aspects, inner, tall, gap, sparing ? 1.3 : 1)
		: oneLarge(aspects, large, inner, tall, gap);
}

/**
 * In the number of columns that makes the pictures largest: side by side without gaps between
 * them, the last row in the middle where it has fewer.
 * @param {number[]} aspects
 * @param {number} inner
 * @param {number} tall
 * @param {number} gap
 * @param {number} worth  how many times larger pictures must be with another row of them
 */
function alike(aspects, inner, tall, gap, worth) {
	const widest = Math.max(...aspects);
	const grids = aspects.map((_, index) => {
		const columns = index + 1;
		const rows = Math.ceil(aspects.length / columns);
		const width = (inner - gap * (columns - 1)) / columns;
		return { columns, rows, height: Math.min((tall - gap * (rows - 1)) / rows, width / widest) };
	});
	const { columns, rows, height } = grids.reduceRight((best, grid) =>
		grid.height > best.height * worth + 0.5 ? grid : best,
	);
	const width = height * widest;
	const cells = aspects.map((aspect, index) => {
		const row = Math.floor(index / columns);
		const inRow = Math.min(columns, aspects.length - row * columns);
		const left = (inner - inRow * width - (inRow - 1) * gap) / 2;
		return fit(aspect, {
			x: gap + left + (index % columns) * (width + gap),
			y: gap + row * (height + gap),
			width,
			height,
		});
	});
	return { cells, height: Math.round(rows * (height + gap) + gap) };
}

/**
 * @param {number[]} aspects
 * @param {number} large
 * @param {number} inner
 * @param {number} tall
 * @param {number} gap
 */
function oneLarge(aspects, large, inner, tall, gap) {
	const others = aspects.length - 1;
	const rows = others <= 3 ? Math.max(2, others) : Math.ceil(others / 2);
	const columns = Math.ceil(others / rows);
	const small = Math.max(...aspects.filter((_, index) => index !== large));
	// Width = a H + columns (gap + b h), with h = (H - gap (rows - 1)) / rows.
	const wanted =
		(inner - columns * gap + (columns * small * gap * (rows - 1)) / rows) /
		(aspects[large] + (columns * small) / rows);
	const height = Math.min(wanted, tall);
	const cellHeight = (height - gap * (rows - 1)) / rows;
	const bigWidth = aspects[large] * height;
	// No wider than their pictures: what is left of the width lies around all of them.
	const cellWidth = Math.min((inner - bigWidth - columns * gap) / columns, small * cellHeight);
	const begin = gap + (inner - bigWidth - columns * (gap + cellWidth)) / 2;
	const cells = aspects.map((aspect, index) => {
		if (index === large) return fit(aspect, { x: begin, y: gap, width: bigWidth, height });
		const place = index - Number(index > large);
		const x = begin + bigWidth + gap + Math.floor(place / rows) * (cellWidth + gap);
		return fit(aspect, {
			x,
			y: gap + (place % rows) * (cellHeight + gap),
			width: cellWidth,
			height: cellHeight,
		});
	});
	return { cells, height: Math.round(height + 2 * gap) };
}

/**
 * The largest picture of a shape in the middle of a frame, on whole pixels.
 * @param {number} aspect
 * @param {Cell} frame
 */
function fit(aspect, { x, y, width, height }) {
	const w = Math.min(width, height * aspect);
	const hgt = w / aspect;
	return {
		x: Math.round(x + (width - w) / 2),
		y: Math.round(y + (height - hgt) / 2),
		width: Math.round(w),
		height: Math.round(hgt),
	};
}

/* ---------- Looking closer at a picture: wheel or two fingers magnify at the pointer, a drag
   moves what is magnified, a double click goes in and out. */

const MOST = 24;
/** What a double click magnifies by. */
const CLOSER = 3;
/** A press that moves less than this is a click, CSS pixels. */
const STILL = 4;

/**
 * The magnification after a factor at a point that keeps its place.
 * @param {Magnified | undefined} zoom
 * @param {number} factor
 * @param {{x: number, y: number, width: number, height: number}} spot  in its cell, CSS pixels
 * @returns {Magnified | undefined} undefined: the whole picture
 */
export function magnified(zoom, factor, { x, y, width, height }) {
	const { k, left, top } = lensOf(zoom, width, height);
	const next = Math.min(MOST, k * factor);
	if (next < 1.02) return undefined;
	const centre = (
		/** @type {number} */ at,
		/** @type {number} */ gone,
		/** @type {number} */ side,
	) => (((at + gone) / k) * next - at + side / 2) / (next * side);
	return [next, centre(x, left, width), centre(y, top, height)];
}

/** @param {HTMLElement} body  the pictures @param {Store<PageState>} store */
function mountMagnifier(body, store) {
	/** @type {Map<number, {x: number, y: number}>} */
	const fingers = new Map();
	let travelled = 0;

	/** @param {MouseEvent} event */
	function spotOf({ target, clientX, clientY }) {
		const cam = /** @type {Element} */ (target).closest(".cam");
		if (!cam) return null;
		const { left, top, width, height } = cam.getBoundingClientRect();
		const index = [...body.children].indexOf(cam);
		return { cam, index, x: clientX - left, y: clientY - top, width, height };
	}
	/** @param {number} index @param {Magnified | undefined} zoom */
	function put(index, zoom) {
		const zooms = { ...store.get().zooms };
		if (zoom) zooms[index] = zoom;
		else delete zooms[index];
		store.set({ zooms });
	}

	body.addEventListener(
		"wheel",
		(event) => {
			const spot = spotOf(event);
			if (!spot) return;
			event.preventDefault();
			put(
				spot.index,
				magnified(store.get().zooms[spot.index], Math.exp(-event.deltaY * 0.002), spot),
			);
		},
		{ passive: false },
	);
	body.addEventListener("dblclick", (event) => {
		const spot = spotOf(event);
		if (!spot || event.shiftKey) return;
		const zoom = store.get().zooms[spot.index];
		put(spot.index, zoom ? undefined : magnified(zoom, CLOSER, spot));
	});
	body.addEventListener("pointerdown", (event) => {
		if (event.button !== 0 || !spotOf(event)) return;
		if (!fingers.size) travelled = 0;
		fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
	});
	body.addEventListener("pointermove", (event) => {
		// It may have been let go outside, before anything was captured.
		if (!event.buttons) fingers.delete(event.pointerId);
		const before = fingers.get(event.pointerId);
		const spot = spotOf(event);
		if (!before || !spot) return;
		const now = { x: event.clientX, y: event.clientY };
		const [dx, dy] = [now.x - before.x, now.y - before.y];
		travelled += Math.hypot(dx, dy);
		fingers.set(event.pointerId, now);
		if (travelled < STILL) return;
		// From now on it is no click, and it goes on where it leaves the picture.
		spot.cam.setPointerCapture(event.pointerId);
		const zoom = store.get().zooms[spot.index];
		const other = [...fingers].find(([id]) => id !== event.pointerId)?.[1];
		if (other) {
			const far = (/** @type {{x: number, y: number}} */ at) =>
				Math.max(20, Math.hypot(at.x - other.x, at.y - other.y));
			put(spot.index, magnified(zoom, far(now) / far(before), spot));
		} else if (zoom) {
			const [k, x, y] = zoom;
			put(spot.index, [k, x - dx / (k * spot.width), y - dy / (k * spot.height)]);
		}
	});
	for (const kind of /** @type {const} */ (["pointerup", "pointercancel"]))
		body.addEventListener(kind, ({ pointerId }) => fingers.delete(pointerId));
	capture(body, "click", (event) => {
		if (travelled >= STILL) event.stopPropagation();
		travelled = 0;
	});
}

/** As wide as this a picture has its words in one line, CSS pixels: as in panes.css. */
const NARROW = 260;

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
			const [name, words] = [h("b", camera.name), h("span")];
			const absent = h("p.cam-absent", { hidden: true });
			const card = h("div.card", { hidden: true });
			const through = () => {
				clearTimeout(clicked);
				actions.lookThrough(index);
			};
			const element = h(
				"div.cam",
				{
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
				h("div.cam-tag", name, words),
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
		if (stale) words.push("run before");
		else if (result && !result.computed)
			words.push(store.get().run?.state === "computing" ? "computing" : "not computed");
		else if (view && roomy) {
			if (view.events.length) words.push(`2D: ${viewWords(view.events)}`);
			// Of a narrower one they would be cut; the tab Step has them.
			if (layers2d.samples && places[index].width > NARROW)
				words.push(...gateWords(view.information));
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
			h("h3", opening ? `Opening ${opening.name}` : "No sequence is open"),
			h("p", opening ? "reading" : "Choose one at the top left: a built-in room needs no data."),
			sample &&
				h("button.btn.main", { onclick: () => actions.open(sample.name) }, `Open ${sample.name}`),
		);
	}

	mountMagnifier(body, store);
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
