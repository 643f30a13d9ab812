/** The cameras: pictures and what is drawn over them, painted together. */
import { fill, h, icon, idTag, parts, show, write } from "../elements/dom.js";
import { prepare } from "../draw/canvas.js";
import { drawEmptyPicture, drawOverlay, visibleTracks } from "../draw/overlay.js";
import { isAlone, viewWords } from "../state/events.js";
import { mosaic } from "../draw/mosaic.js";
import { pictureInk } from "../draw/colours.js";

/** A second click within this time makes it a double click, milliseconds. */
const DOUBLE_CLICK = 220;

/** @type {Pane} */
export function mountCameras(root, { store, actions, playback }) {
	const { mosaic: body, blank } = parts(root);
	/**
	 * @type {{element: HTMLElement, canvas: HTMLCanvasElement, name: HTMLElement, words: HTMLElement,
	 * card: HTMLElement}[]}
	 */
	let cells = [];
	/** @type {Cell[]} */
	let places = [];
	/** @type {Frame | null} */
	let frame = null;
	let sequenceKey = "";
	/** @type {Timer} */
	let clicked;
	const cameras = () => store.get().cameras;

	function build() {
		sequenceKey = store.get().sequence?.key ?? "";
		frame = null;
		cells = cameras().map((camera, index) => {
			const canvas = h("canvas");
			const [name, words] = [h("b", {}, camera.name), h("span")];
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
					"aria-label": `Camera ${camera.name}: Enter makes it large, Shift and Enter look through it in 3D`,
					onclick: (event) => {
						const id = store.get().hover?.id;
						if (id !== undefined) actions.select(id);
						else if (event.detail < 2)
							clicked = setTimeout(() => actions.chooseCamera(index), DOUBLE_CLICK);
					},
					ondblclick: through,
					onkeydown: (event) =>
						event.key === "Enter" && (event.shiftKey ? through() : actions.chooseCamera(index)),
					onpointermove: (event) => point(index, event),
					onpointerleave: () => store.set({ hover: null }),
				},
				canvas,
				h("div", { class: "cam-tag" }, name, words),
				card,
			);
			return { element, canvas, name, words, card };
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
		const natural = parseFloat(getComputedStyle(root).getPropertyValue("--h-cam")) * 1.1 + 8;
		const { cells: found, height } = mosaic(
			cameras().map((c) => c.width / c.height),
			large,
			{ width: root.clientWidth, most: own ? body.clientHeight : natural, gap: 4 },
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
		const { sequence, layers2d: layers, selection, hover } = store.get();
		if (sequence?.key !== sequenceKey) return;
		const ink = pictureInk();
		cells.forEach(({ element, canvas, words }, index) => {
			// what is drawn says which step it is of, so that a test can hold them against each other
			element.dataset.step = String(next.step);
			element.dataset.overlay = String(next.result?.step ?? "");
			const { width, height } = places[index];
			const g = prepare(canvas, width, height);
			const bitmap = next.pictures[index]?.bitmap;
			const view = next.result?.cameras[index];
			if (bitmap) {
				g.imageSmoothingQuality = "medium";
				g.drawImage(bitmap, 0, 0, width, height);
			} else drawEmptyPicture(g, width, height);
			for (const map of next.maps[index] ?? [])
				if (map.bitmap) g.drawImage(map.bitmap, 0, 0, width, height);
			const scale = width / cameras()[index].width;
			if (view)
				drawOverlay(g, view, {
					scale,
					width,
					height,
					layers,
					selection,
					hover: hover?.id ?? null,
					alone: isAlone(store.get()),
					people: next.result?.truth ?? [],
					opacity: next.stale ? 0.45 : 1,
					ink,
				});
			write(words, wordsOf(next, index, width > 260));
		});
		placeCards();
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
		const view = result?.cameras[index];
		if (stale) words.push("computing");
		else if (result && !result.computed)
			words.push(store.get().run?.state === "computing" ? "computing" : "not computed");
		else if (view) {
			if (view.events.length) words.push(`2D: ${viewWords(view.events)}`);
			/** @type {Record<string, number[]>} */
			const away = {};
			for (const { id, visible, reason } of view.tracks)
				if (!visible) (away[reason ?? "out of view"] ??= []).push(id);
			for (const [why, ids] of Object.entries(away))
				words.push(`${ids.slice(0, 4).join(", ")}${ids.length > 4 ? " …" : ""} ${why}`);
		}
		return words.map((word) => ` · ${word}`).join("");
	}

	/** @param {number} index @param {PointerEvent} event */
	function point(index, event) {
		const view = frame && !frame.stale ? frame.result?.cameras[index] : undefined;
		if (!view || !store.get().layers2d.boxes) return;
		const scale = places[index].width / cameras()[index].width;
		const [x, y] = [event.offsetX / scale, event.offsetY / scale];
		const id = visibleTracks(view)
			.reverse()
			.find(
				({ box: [left, top, width, height] }) =>
					x >= left && x <= left + width && y >= top && y <= top + height,
			)?.id;
		const before = store.get().hover;
		if (before?.id !== id || (before && before.camera !== index))
			store.set({ hover: id === undefined ? null : { id, camera: index } });
	}

	/** The card stands left of its box, else right; never over it. */
	function placeCards() {
		const { hover } = store.get();
		cells.forEach(({ card }, index) => {
			// What is pointed at elsewhere is explained in the large picture.
			const here = hover && (hover.camera < 0 ? (store.get().large ?? 0) : hover.camera) === index;
			const track = here
				? frame?.result?.cameras[index].tracks.find((t) => t.id === hover.id)
				: undefined;
			card.hidden = !track?.box;
			if (!track?.box) return;
			fillCard(card, track);
			const { width, height, x } = places[index];
			const scale = width / cameras()[index].width;
			const left = track.box[0] * scale - card.offsetWidth - 8;
			const right = Math.min(
				(track.box[0] + track.box[2]) * scale + 8,
				root.clientWidth - x - card.offsetWidth - 4,
			);
			card.style.left = `${Math.round(left + x >= 4 ? left : right)}px`;
			card.style.top = `${Math.round(Math.max(4, Math.min(track.box[1] * scale, height - card.offsetHeight - 28)))}px`;
		});
	}

	/** @param {HTMLElement} card @param {Server.CameraTrack} track */
	function fillCard(
		card,
		{ id, seen, detection_probability: p, hidden_by: front, reason, source, fed_by: fed },
	) {
		const whole = frame?.result?.tracks.find((t) => t.id === id);
		const row = (/** @type {Child | Child[]} */ word, /** @type {Child[]} */ ...value) => [
			h("dt", {}, word),
			h("dd", {}, ...value),
		];
		fill(
			card,
			h("h3", {}, idTag(id), seen ? "seen" : "coasting"),
			h(
				"dl",
				{},
				whole && row("existence", whole.existence.toFixed(2)),
				p !== null &&
					row(
						[h("i", {}, "p"), h("sub", {}, "D")],
						show(Number(p.toFixed(3))),
						h("small", {}, front !== null ? ` hidden by ${front}` : reason ? ` ${reason}` : ""),
					),
				row(
					"fed by",
					...(seen && fed
						? [
								`box ${source + 1}`,
								h(
									"small",
									{},
									`, ${Math.round(100 * fed.share)} % sure, weight ${show(Number(fed.weight.toPrecision(2)))}`,
								),
							]
						: ["no box here"]),
				),
				whole &&
					row(
						"at",
						whole.position.map((v) => v.toFixed(2).replace("-", "−")).join("  "),
						h("small", {}, " m"),
					),
			),
		);
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
			opening &&
				h(
					"span",
					{ class: "bar", "--part": opening.total ? opening.done / opening.total : 0 },
					h("i"),
				),
			h(
				"p",
				{},
				opening
					? `${opening.message}${opening.total ? `, ${opening.done} of ${opening.total}` : ""}`
					: "Choose one at the top left: a rendered room needs no data.",
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
	store.on(["selection", "hover", "layers2d", "layers3d"], playback.repaint);
	new ResizeObserver(arrange).observe(root);
	addEventListener("panes", arrange);
}
