/**
 * Teaching: boxes dragged on a picture, and the fields of its panel, each of which says where
 * it is sent.
 */
import { lensOf } from "../draw/overlay.js";
import { claim, capture, all, h, one } from "../elements/dom.js";
import { ARROWS } from "../elements/drawn.js";
import { resultOf } from "../state/events.js";

/* ---------- A box over a picture without a pointer: arrows move it, with Ctrl they size it,
   with Shift they go further; Enter keeps it. */

/** Of a press of an arrow, pixels of the picture. */
const [SMALL, LARGE] = [1, 10];

/** Sides of a box are no shorter than this, pixels of the picture. */
const LEAST = 4;

/** @typedef {{left: number, top: number, width: number, height: number}} Sides */

/**
 * @param {HTMLElement} mosaic  the pictures
 * @param {Store<PageState>} store
 * @param {object} does
 * @param {(cell: HTMLElement, sides: Sides) => void} does.keep
 * @param {(words: string) => void} does.tell  where the box is
 */
function mountFrame(mosaic, store, { keep, tell }) {
	/** @type {{cell: HTMLElement, index: number, sides: Sides} | null} */
	let at = null;
	const frame = h("button.drawn.framed", { onkeydown: keyed });

	/** In a picture, around the selected person where it is seen there. @param {HTMLElement} cell */
	function begin(cell) {
		const index = [...mosaic.children].indexOf(cell);
		const camera = store.get().cameras[index];
		if (!camera) return;
		const found = resultOf(store.get())?.cameras[index]?.tracks.find(
			({ id, visible }) => visible && id === store.get().selection,
		)?.box;
		const [left, top, width, height] = found ?? [
			camera.width * 0.45,
			camera.height * 0.3,
			camera.width * 0.1,
			camera.height * 0.4,
		];
		at = { cell, index, sides: { left, top, width, height } };
		// Beside the pictures, which are buttons themselves.
		mosaic.after(frame);
		put();
		frame.focus();
	}

	function end() {
		at = null;
		frame.remove();
	}

	/** @param {KeyboardEvent} event */
	function keyed(event) {
		if (!at) return;
		const { sides, index } = at;
		const { width: wide, height: high } = store.get().cameras[index];
		const far = event.shiftKey ? LARGE : SMALL;
		const way = ARROWS[event.key];
		const within = (
			/** @type {number} */ value,
			/** @type {number} */ least,
			/** @type {number} */ most,
		) => Math.round(Math.max(least, Math.min(most, value)) * 10) / 10;
		if (way && (event.ctrlKey || event.metaKey)) {
			sides.width = within(sides.width + far * way[0], LEAST, wide - sides.left);
			sides.height = within(sides.height + far * way[1], LEAST, high - sides.top);
		} else if (way) {
			sides.left = within(sides.left + far * way[0], 0, wide - sides.width);
			sides.top = within(sides.top + far * way[1], 0, high - sides.height);
		} else if (event.key === "Enter") {
			const { cell } = at;
			end();
			keep(cell, sides);
		} else if (event.key === "Escape") {
			const { cell } = at;
			end();
			cell.focus();
		} else return;
		claim(event);
		put();
	}

	function put() {
		if (!at) return;
		const { cell, index, sides } = at;
		const { zooms, cameras } = store.get();
		const [left, top, width, height] = Object.values(sides).map(Math.round);
		const words = `${cameras[index].name}: left ${left}, top ${top}, ${width} by ${height} px`;
		frame.ariaLabel = `Box in ${words}. Arrows move it, with Ctrl they size it, Enter keeps it.`;
		tell(words); // which may take a line above the pictures, and move them
		const lens = lensOf(zooms[index], cell.clientWidth, cell.clientHeight);
		const scale = (cell.clientWidth * lens.k) / cameras[index].width;
		Object.assign(frame.style, {
			left: `${mosaic.offsetLeft + cell.offsetLeft + sides.left * scale - lens.left}px`,
			top: `${mosaic.offsetTop + cell.offsetTop + sides.top * scale - lens.top}px`,
			width: `${sides.width * scale}px`,
			height: `${sides.height * scale}px`,
		});
	}
	store.on(["zooms", "large", "layout"], () => requestAnimationFrame(put));
	new ResizeObserver(put).observe(mosaic);
	store.on(["sequence"], end);
	return { begin, end };
}

const DRAW = "Drag a box around a person, or Enter for one that arrows move. Esc leaves.";
const FRAME = "Arrows move the box, with Ctrl they size it, with Shift further; Enter keeps it.";
const NAME = "Whose colours are these? Type a name: Enter keeps it, Esc leaves it as it is.";

/** What the form of a template without a mouse is called. */
export const NUMBERS = "Template by numbers";

/** @param {HTMLElement} mosaic  the pictures @param {Context} context */
export function mountTeach(mosaic, { store, actions }) {
	const panel = one("#panel-teach");
	const drawn = h("div.drawn");
	const hint = h("p.hint", { role: "status", hidden: true }, DRAW);
	mosaic.before(hint);
	/** Where a drag began.  @type {{cam: HTMLElement, x: number, y: number} | null} */
	let begun = null;
	/** How many templates there are when the new one is listed. */
	let added = Infinity;
	/** The name that the page asks for: only Enter keeps what was typed, since nobody chose the field. */
	let asked = "";
	/** What is being sent; saving comes after it. */
	/** @type {Promise<any>} */
	let sending = Promise.resolve();

	const frame = mountFrame(mosaic, store, {
		keep: (cell, sides) => {
			hint.textContent = DRAW;
			add(cell, sides);
		},
		tell: (words) => (hint.textContent = `${FRAME} ${words}`),
	});
	actions.compareWith = async (method) => {
		if (!(await actions.ask("POST", "run/pin"))) return;
		await actions.change({ single_view: method });
		actions.showTab("compare");
	};
	actions.drawTemplate = () => {
		begun = null;
		drawn.remove();
		frame.end();
		hint.textContent = DRAW;
		hint.hidden = !hint.hidden;
		mosaic.classList.toggle("drawing", !hint.hidden);
		one("[data-command=draw-template]").ariaPressed = String(!hint.hidden);
		store.set({ playing: 0, follow: false });
	};
	const { clear } = actions;
	actions.clear = () => (hint.hidden ? clear : actions.drawTemplate)();

	/**
	 * @param {PointerEvent} event
	 * @returns {number[]} left, top, width and height on the picture, CSS pixels
	 */
	function box({ clientX, clientY }) {
		if (!begun) return [0, 0, 0, 0];
		const { left, top, width, height } = begun.cam.getBoundingClientRect();
		const [x, y] = [
			Math.max(0, Math.min(width, clientX - left)),
			Math.max(0, Math.min(height, clientY - top)),
		];
		return [
			Math.min(x, begun.x),
			Math.min(y, begun.y),
			Math.abs(x - begun.x),
			Math.abs(y - begun.y),
		];
	}
	/** @param {HTMLElement} cam @param {import("./teach.js").Sides} sides  pixels of its picture */
	function add(cam, sides) {
		const camera = store.get().cameras[[...mosaic.children].indexOf(cam)];
		actions.showTab("teach");
		added = (store.get().sequence?.templates ?? 0) + 1;
		void actions.command("add_template", {
			camera: camera.name,
			step: Number(cam.dataset.step),
			...sides,
		});
	}
	/** @type {Record<string, (event: any) => void>} */
	const drag = {
		pointerdown(event) {
			const cam = event.target.closest(".cam");
			if (!cam) return;
			const { left, top } = cam.getBoundingClientRect();
			frame.end();
			hint.textContent = DRAW;
			begun = { cam, x: event.clientX - left, y: event.clientY - top };
			cam.setPointerCapture(event.pointerId);
			cam.append(drawn);
			drag.pointermove(event);
		},
		pointermove(event) {
			const [left, top, width, height] = box(event).map((side) => `${side}px`);
			Object.assign(drawn.style, { left, top, width, height });
		},
		pointerup(event) {
			const sides = box(event);
			const cam = begun?.cam;
			begun = null;
			drawn.remove();
			if (!cam || Math.min(sides[2], sides[3]) < 4) return;
			const index = [...mosaic.children].indexOf(cam);
			const camera = store.get().cameras[index];
			// Also of a picture that is looked at closer.
			const lens = lensOf(store.get().zooms[index], cam.clientWidth, cam.clientHeight);
			const scale = (cam.clientWidth * lens.k) / camera.width;
			const [left, top] = [(sides[0] + lens.left) / scale, (sides[1] + lens.top) / scale];
			add(cam, { left, top, width: sides[2] / scale, height: sides[3] / scale });
		},
		click() {},
		dblclick() {},
	};
	for (const [name, act] of Object.entries(drag)) {
		capture(mosaic, name, (event) => {
			if (hint.hidden) return;
			event.stopPropagation();
			act(event);
		});
	}

	// In the picture that has the focus, else in the large one or the first.
	capture(document, "keydown", (event) => {
		const target = /** @type {HTMLElement} */ (event.target);
		if (event.key !== "Enter" || hint.hidden || document.querySelector("dialog[open]")) return;
		const own = /** @type {HTMLElement | null} */ (target.closest(".cam"));
		if (!own && target.closest("button, a, input, select, summary, tr, [role=listbox]")) return;
		const cell = own ?? all(".cam", mosaic)[store.get().large ?? 0];
		if (!cell) return;
		claim(event);
		frame.begin(cell);
	});

	/** A command, or a method and a path. @param {any} from @param {string} kind @param {() => object} body */
	function send(from, kind, body) {
		if (!from?.matches(kind)) return;
		const [name, path] = from.dataset.send.split(" ");
		const told = { ...JSON.parse(from.dataset.body ?? "{}"), ...body() };
		sending = path ? actions.ask(name, path, told) : actions.command(name, told);
	}
	const { saveTaught } = actions;
	actions.saveTaught = () => void sending.then(saveTaught);
	panel.addEventListener("keydown", (event) => {
		const field = /** @type {HTMLInputElement} */ (event.target);
		if (!field.matches("input")) return;
		const keeps = event.key === "Enter" || ((event.ctrlKey || event.metaKey) && event.key === "s");
		if (keeps && field.id === asked) asked = "";
		if (event.key === "Escape") field.value = field.defaultValue;
		if (event.key === "Escape") field.blur();
		if (event.key !== "Enter" || field.form) return;
		const stops = all("input, select, button", panel);
		(stops[stops.indexOf(/** @type {any} */ (field)) + 1] ?? panel).focus();
	});
	panel.addEventListener("focusout", () => {
		asked = "";
		hint.textContent = DRAW;
	});
	panel.onclick = ({ target }) => {
		const button = /** @type {HTMLElement} */ (target).closest("button");
		send(button, "[data-send]", () => ({}));
	};
	panel.onchange = ({ target }) => {
		const field = /** @type {HTMLInputElement} */ (target);
		if (field.id === asked) field.value = field.defaultValue;
		else send(field, "[data-send]", () => ({ [field.name]: field.value }));
	};
	panel.onsubmit = (event) => {
		event.preventDefault();
		const { ariaLabel } = /** @type {HTMLFormElement} */ (event.target);
		const before = store.get().sequence?.templates ?? 0;
		// The name of a template by numbers is asked for as that of a drawn one.
		if (ariaLabel === NUMBERS) added = before + 1;
		send(event.target, "form", () =>
			Object.fromEntries(
				[...new FormData(/** @type {HTMLFormElement} */ (event.target))].filter(
					([, value]) => value,
				),
			),
		);
		// What was taken is not sent once more by the next Enter, what was refused can be mended.
		void sending.then((told) => {
			/** @type {HTMLFormElement | null} */
			const form = panel.querySelector(`form[aria-label="${ariaLabel}"]`);
			if (told) form?.reset();
			else added = Infinity;
		});
	};
	// The name of a new template is asked for where it is listed.
	new MutationObserver(() => {
		const names = all("[id^=template-]", panel);
		if (names.length < added) return;
		added = Infinity;
		const field = names[names.length - 1];
		field.select();
		field.scrollIntoView({ block: "center" });
		asked = field.id;
		hint.textContent = NAME;
	}).observe(panel, { childList: true, subtree: true });
}
