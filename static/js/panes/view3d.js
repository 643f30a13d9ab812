/** The 3D pane: viser's page inside ours, with its layers and view points. */
import { drawing } from "../draw/canvas.js";
import { capture, all, fill, h, icon, one, parts } from "../elements/dom.js";

/* ---------- How often another document of this window draws: viser goes on drawing for a while
   after each change, and where there is no graphics card each of its frames is one that pictures
   and overlays have to wait for. */

/** Who turns or moves the 3D view wants every frame, for so long after, milliseconds. */
const TOUCHED = 400;

/**
 * Have a window's animation frames come no earlier than they may.
 * @param {Window} view
 * @param {(last: number, cost: number) => number} after  when, from when the last one was (the page's
 * clock) and how long it was until the browser was ready for another
 */
export function pace(view, after) {
	const ask = view.requestAnimationFrame.bind(view);
	const cancel = view.cancelAnimationFrame.bind(view);
	/** Those that wait, by a number of ours. @type {Map<number, Timer>} */
	const waiting = new Map();
	/** What the browser calls those that have waited. @type {Map<number, number>} */
	const asked = new Map();
	let [last, cost, touched, counted] = [0, 0, -Infinity, 2 ** 31];

	for (const name of ["pointerdown", "pointermove", "wheel"])
		view.addEventListener(
			name,
			(event) => {
				if (name !== "pointermove" || /** @type {PointerEvent} */ (event).buttons)
					touched = performance.now();
			},
			{ capture: true, passive: true },
		);
	view.requestAnimationFrame = (act) => {
		const now = performance.now();
		const rest = now - touched < TOUCHED ? 0 : after(last, cost) - now;
		if (rest <= 0) return ask(drawn(act));
		const own = (counted += 1);
		const then = () => {
			waiting.delete(own);
			const known = ask((time) => (asked.delete(own), drawn(act)(time)));
			asked.set(own, known);
		};
		waiting.set(own, setTimeout(then, rest));
		return own;
	};
	view.cancelAnimationFrame = (number) => {
		clearTimeout(waiting.get(number));
		waiting.delete(number);
		cancel(asked.get(number) ?? number);
		asked.delete(number);
	};
	/** @param {FrameRequestCallback} act @returns {FrameRequestCallback} */
	const drawn = (act) => (time) => {
		const begun = (last = performance.now());
		act(time);
		// What was told to the graphics card is still to be drawn.
		ask(() => (cost = performance.now() - begun));
	};
}

/** What draws WebGL here where it is no graphics card; empty where it is one, or not told. */
function softwareRenderer() {
	const gl = document.createElement("canvas").getContext("webgl2");
	const info = gl?.getExtension("WEBGL_debug_renderer_info");
	const name = String((info && gl?.getParameter(info.UNMASKED_RENDERER_WEBGL)) ?? "");
	gl?.getExtension("WEBGL_lose_context")?.loseContext();
	return /swiftshader|llvmpipe|softpipe|software/i.test(name) ? name : "";
}

/* ---------- Numbers of viser's panel count when they are finished: it takes each letter for a
   number, and a 0 on the way to 0.9 for the least one that is allowed ---------- */

/** Fields of numbers ask touch screens for digits. */
const FIELD = "input[inputmode=decimal]";

/** Keys that end a number, or change it by a step. */
const ENDS = ["Enter", "ArrowUp", "ArrowDown"];

/** Have the fields of a document keep what is typed until it is finished; Escape takes it back. @param {Document} page */
function takeWholeNumbers(page) {
	let passing = false;
	let before = "";
	/** @param {Event} event */
	const fieldOf = ({ target }) => {
		const element = /** @type {HTMLInputElement} */ (target);
		return element.matches?.(FIELD) ? element : null;
	};
	/** @param {HTMLInputElement} field */
	const pass = (field) => {
		passing = true;
		field.dispatchEvent(new Event("input", { bubbles: true }));
		passing = false;
		before = field.value;
	};
	capture(page, "focusin", (event) => (before = fieldOf(event)?.value ?? ""));
	capture(page, "input", (event) => {
		if (!passing && fieldOf(event)) event.stopImmediatePropagation();
	});
	capture(page, "keydown", (event) => {
		const field = fieldOf(event);
		if (!field) return;
		if (ENDS.includes(event.key)) pass(field);
		if (event.key === "Escape") field.value = before;
	});
	capture(page, "focusout", (event) => {
		const field = fieldOf(event);
		if (field) pass(field);
	});
}

/** The 3D view waits no longer than this for the first pictures, milliseconds. */
const LATEST = 3000;

/** @type {Pane} */
export function mountView3d(root, { store, actions, playback, retry, press }) {
	const { views, frame, blank, trail, software } = parts(root);
	let path = "";
	let reachable = false;
	let tries = 0;
	/** @type {Timer} */
	let timer;
	/** Where it is slow, the first pictures do not wait for it. @type {Promise<void> | undefined} */
	let painted;

	if (softwareRenderer()) {
		playback.slow3d();
		drawing.willReadFrequently = true;
		painted = new Promise((resolve) => {
			playback.onPaint(() => resolve(undefined));
			setTimeout(resolve, LATEST);
		});
		software.hidden = false;
	}

	async function load() {
		clearTimeout(timer);
		if (!path) return;
		await painted;
		frame.src = path;
	}
	// After a click into 3D its document has the keys; ours come first, but for those that move its
	// camera.
	frame.addEventListener("load", () => {
		const view = frame.contentWindow;
		if (!view || !frame.src) return;
		// A browser's error page, which is nobody's to read, or the server's word that 3D is not there.
		reachable = Boolean(frame.contentDocument?.getElementById("root"));
		tries = reachable ? 0 : tries + 1;
		if (!reachable && store.get().link === "open")
			timer = setTimeout(load, Math.min(8000, 1000 * 2 ** tries));
		cover();
		if (!reachable) return;
		pace(view, playback.after3d);
		takeWholeNumbers(view.document);
		capture(view, "keydown", (event) => {
			if (/^(Arrow.*|[wasdqe])$/i.test(event.key) && !event.ctrlKey && !event.metaKey) return;
			if (press(event)) event.stopImmediatePropagation();
		});
	});

	function cover() {
		const { link, server } = store.get();
		blank.hidden = reachable && link !== "lost";
		if (blank.hidden) return;
		const say = (
			/** @type {string} */ title,
			/** @type {string} */ text,
			/** @type {() => void} */ onclick,
		) =>
			fill(
				blank,
				icon("i-plug", "l"),
				h("h3", title),
				h("p", text),
				h("button.btn.box", { onclick }, "Try now"),
			);
		if (link === "lost")
			say("3D view lost", "Pictures and results that were loaded can still be looked at.", retry);
		else if (tries > 0)
			say(
				"The 3D view does not answer",
				"Pictures, timeline and tables still work. It is tried again by itself.",
				load,
			);
		else fill(blank, h("p", server ? "Loading the 3D view" : "Connecting"));
	}

	function header() {
		const { server, cameras, link } = store.get();
		one("[data-command=edit-room]", root).ariaPressed = String(
			Boolean(server?.teaching.editing_room),
		);
		/** @type {[string, number | "top" | null, string, string][]} */
		const points = [
			["free", null, "Free view", "0"],
			["top", "top", "From above", "U"],
			...cameras.map(
				({ name }, index) =>
					/** @type {[string, number, string, string]} */ ([
						`C${index + 1}`,
						index,
						`Look through ${name}`,
						"",
					]),
			),
		];
		if (views.childElementCount !== points.length) {
			fill(
				views,
				points.map(([name, view, tip, key]) =>
					h(
						"button",
						{ "data-tip": tip, "data-key": key, onclick: () => actions.lookThrough(view) },
						name,
					),
				),
			);
		}
		all("button", views).forEach((button, index) => {
			button.ariaPressed = String(points[index][1] === (server?.view ?? null));
			button.disabled = link !== "open";
		});
	}

	trail.addEventListener("change", () => {
		actions.trail({ seconds: Number(trail.value) });
		trail.blur();
	});
	store.on(["server"], ({ server }) => {
		trail.value = String(server?.trail.seconds ?? "");
		header();
		cover();
		if (server && server.viser.path !== path) {
			path = server.viser.path;
			void load();
		}
	});
	let wasLost = false;
	store.on(["link"], ({ link }) => {
		if (link === "open" && wasLost) {
			tries = 0;
			void load();
		}
		wasLost = link === "lost" || (wasLost && link !== "open");
		cover();
	});
	store.watch(["link"], header);
	cover();
}
