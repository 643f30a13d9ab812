/**
 * Teaching: boxes dragged on a picture, and the fields of a panel that the server writes; each says
 * where it is sent.
 */
import { lensOf } from "../draw/picture.js";
import { all, h, one } from "../elements/dom.js";
import { mountFrame } from "./frame.js";

const DRAW = "Drag a box around a person, or Enter for one that arrows move. Esc leaves.";
const FRAME = "Arrows move the box, with Ctrl they size it, with Shift further; Enter keeps it.";
const NAME = "Whose colours are these? Type a name: Enter keeps it, Esc leaves it as it is.";

/** What the form of a template without a mouse is called. */
const NUMBERS = "Template by numbers";

/** @param {HTMLElement} mosaic  the pictures @param {Context} context */
export function mountTeach(mosaic, { store, actions }) {
	const panel = one("#panel-teach");
	const drawn = h("div", { class: "drawn" });
	const hint = h("p", { class: "hint", role: "status", hidden: true }, DRAW);
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
	actions.clear = () =>
		(hint.hidden
			? store.get().server?.teaching.editing_room
				? actions.editRoom
				: clear
			: actions.drawTemplate)();

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
	/** @param {HTMLElement} cam @param {import("./frame.js").Sides} sides  pixels of its picture */
	function add(cam, sides) {
		const camera = store.get().cameras[[...mosaic.children].indexOf(cam)];
		actions.showTab("teach");
		added = (store.get().sequence?.templates ?? 0) + 1;
		void actions.ask("POST", "teach/templates", {
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
		mosaic.addEventListener(
			name,
			(event) => {
				if (hint.hidden) return;
				event.stopPropagation();
				act(event);
			},
			true,
		);
	}

	// In the picture that has the focus, else in the large one or the first.
	document.addEventListener(
		"keydown",
		(event) => {
			const target = /** @type {HTMLElement} */ (event.target);
			if (event.key !== "Enter" || hint.hidden || document.querySelector("dialog[open]")) return;
			const own = /** @type {HTMLElement | null} */ (target.closest(".cam"));
			if (!own && target.closest("button, a, input, select, summary, tr, [role=listbox]")) return;
			const cell = own ?? all(".cam", mosaic)[store.get().large ?? 0];
			if (!cell) return;
			event.preventDefault();
			event.stopPropagation();
			frame.begin(cell);
		},
		true,
	);

	/** @param {any} from @param {string} kind @param {() => object} body */
	function send(from, kind, body) {
		const [method, path] = from?.matches(kind) ? from.dataset.send.split(" ") : [];
		if (path) sending = actions.ask(method, path, body());
	}
	const { saveTaught } = actions;
	actions.saveTaught = () => void sending.then(saveTaught);
	panel.addEventListener("keydown", (event) => {
		const field = /** @type {HTMLInputElement} */ (event.target);
		if (!field.matches("input")) return;
		const keeps = event.key === "Enter" || ((event.ctrlKey || event.metaKey) && event.key === "s");
		if (keeps && field.id === asked) asked = "";
		if (event.key === "Escape") field.value = field.defaultValue;
		if (event.key === "Escape" || (event.key === "Enter" && !field.form)) field.blur();
	});
	panel.addEventListener("focusout", () => {
		asked = "";
		hint.textContent = DRAW;
	});
	panel.onclick = ({ target }) => {
		const button = /** @type {HTMLElement} */ (target).closest("button");
		send(button, "[data-send]", () => JSON.parse(button?.dataset.body ?? "{}"));
	};
	panel.onchange = ({ target }) => {
		const field = /** @type {HTMLInputElement} */ (target);
		if (field.id === asked) field.value = field.defaultValue;
		else send(field, "[data-send]", () => ({ value: field.value }));
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

	store.watch(["server"], ({ server }) => {
		const { unsaved = 0, editing_room: editing = false } = server?.teaching ?? {};
		const count = one("[data-ref=unsaved]");
		count.hidden = !unsaved;
		count.textContent = `${unsaved}`;
		one("[data-command=edit-room]").ariaPressed = String(editing);
	});
}
