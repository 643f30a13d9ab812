/**
 * Where somebody stands, said in the pictures: the feet of the selected track have a handle in each
 * picture, to be dragged or moved by arrows; and while a person is placed, every picture takes a
 * click.
 */
import { clickOf, pixelOf, scaleOf } from "./edits.js";
import { claim, capture, colourIndex, h, one } from "../elements/dom.js";
import { ARROWS } from "../elements/drawn.js";
import { getJson } from "../state/api.js";
import { shownVersion } from "../state/events.js";

/** Of a press of an arrow, pixels of the picture. */
const [SMALL, LARGE] = [1, 10];

/** @param {Context} context @param {Check} check */
export function mountFeet({ store, playback }, check) {
	const { state } = check;
	const mosaic = one(".mosaic");
	// Beside the pictures, which are buttons themselves.
	const layer = h("div.feet");
	mosaic.after(layer);
	/** By camera: a place in a picture, whether somebody said it, and where the run has it.
	 * @typedef {Spot & {said: boolean, from: [number, number] | null}} Foot
	 */
	/** @type {Foot[]} */
	let feet = [];
	/** @type {HTMLElement[]} */
	let handles = [];
	let wanted = "";
	/** Whether somebody is to be placed from this moment on. */
	let begun = false;

	/** Who goes to another step places there; what was clicked was of the one before. */
	function goAlong() {
		const { placing } = state.get();
		const { shown } = store.get();
		if (placing && shown >= 0 && placing.step !== shown)
			state.set({ placing: { ...placing, step: shown, clicks: [] } });
	}

	/** The feet of the selected track at the shown step, as the server projects them. */
	async function refresh() {
		const { place, selection, shown, playing, cameras, result } = store.get();
		const { placing } = state.get();
		const track = placing ? placing.track : selection;
		const on = place === "check" && !playing && shown >= 0 && (placing || track !== null);
		const version = shownVersion(store.get());
		const key = on ? `${track} ${shown} ${version} ${Boolean(placing)} ${result?.run}` : "";
		if (key === wanted) return put();
		// A click counts from the moment it is asked for, and stays said whatever arrives later.
		const same = placing && wanted.startsWith(`${track} ${shown} `);
		const clicked = same ? feet.filter(({ said }) => said) : [];
		wanted = key;
		/** @param {([number, number] | null)[] | null} there @param {typeof feet} known */
		const spots = (there, known) =>
			cameras.flatMap(({ name, width, height }, index) => {
				const at = there?.[index];
				if (!at && !placing) return [];
				const [x, y] = at ?? [width / 2, height * 0.75];
				const placed = known.find((one) => one.said && one.index === index);
				return [{ index, camera: name, x, y, said: false, ...placed, from: at ?? null }];
			});
		feet = on && placing ? spots(null, clicked) : [];
		build();
		if (!on || track === null) return;
		// The run may be another by the time that this is answered: its picture asks anew.
		const there = await footprints(track, shown).catch(() => null);
		if (key !== wanted) return;
		if (!there) wanted = "";
		else feet = spots(there, feet);
		build();
	}

	/** @param {number} track @param {number} step @returns {Promise<([number, number] | null)[]>} */
	async function footprints(track, step) {
		/** @type {Server.Step} */
		const result = await getJson(`/api/step/${step}?samples=false&trails=true`);
		return result.cameras.map(({ tracks }) => {
			const found = tracks.find(({ id, visible }) => id === track && visible);
			const now = found?.trail.find(([since]) => since === 0);
			return now ? [now[1], now[2]] : null;
		});
	}

	function build() {
		const { placing } = state.get();
		const { selection } = store.get();
		const was = handles.findIndex((handle) => handle === document.activeElement);
		for (const handle of handles) handle.remove();
		handles = feet.map((foot) => {
			const id = placing ? placing.track : selection;
			const handle = h("button.foothold", {
				"aria-label": `Feet of ${id === null ? "somebody" : `track ${id}`} in ${foot.camera}: drag, or arrows and Enter`,
				onclick: (event) => event.stopPropagation(),
				ondblclick: (event) => event.stopPropagation(),
			});
			handle.addEventListener("pointerdown", (event) => {
				event.stopPropagation();
				if (event.button === 0) handle.setPointerCapture(event.pointerId);
			});
			handle.addEventListener("pointermove", (event) => {
				event.stopPropagation();
				if (!handle.hasPointerCapture(event.pointerId)) return;
				const at = pixelOf(event, store.get(), mosaic.children[foot.index]);
				if (at) move(foot, at.x, at.y);
			});
			handle.addEventListener("pointerup", (event) => {
				event.stopPropagation();
				if (event.button !== 0) return;
				// On a ring that lies where somebody stands a click says so.
				if (state.get().placing) says(foot, foot.x, foot.y);
				else if (foot.said) void send();
			});
			handle.addEventListener("keydown", (event) => keyed(event, foot));
			handle.append(h("span.footbox", { hidden: true }));
			layer.append(handle);
			return handle;
		});
		put();
		// Who places somebody goes on by keys at once.
		if (was >= 0 || begun) handles[Math.max(was, 0)]?.focus({ preventScroll: true });
		begun = false;
	}

	/** @param {Foot} foot @param {number} x @param {number} y */
	function move(foot, x, y) {
		const { width, height } = store.get().cameras[foot.index];
		Object.assign(foot, {
			x: Math.max(0, Math.min(width - 1, x)),
			y: Math.max(0, Math.min(height - 1, y)),
			said: true,
		});
		put();
		tell();
	}

	/** Two pictures are enough; a third click begins with the newest two. @param {Foot} foot @param {number} x @param {number} y */
	function says(foot, x, y) {
		const others = feet.filter((one) => one.said && one !== foot);
		if (others.length > 1) others[0].said = false;
		move(foot, x, y);
	}

	/** @param {KeyboardEvent} event @param {Foot} foot */
	function keyed(event, foot) {
		const far = event.shiftKey ? LARGE : SMALL;
		const way = ARROWS[event.key];
		if (way) move(foot, foot.x + far * way[0], foot.y + far * way[1]);
		else if (event.key === "Enter") {
			// Where the ring lies of somebody who is not known nobody has said yet.
			foot.said ||= foot.from !== null;
			void send();
		} else if (event.key === "Escape") cancel();
		else return;
		claim(event);
	}

	/** What was said so far is told to who places. */
	function tell() {
		const { placing } = state.get();
		if (placing) state.set({ placing: { ...placing, clicks: said() } });
	}
	const said = () => feet.filter(({ said }) => said).map(clickOf);

	async function send() {
		const { placing } = state.get();
		const track = placing ? placing.track : store.get().selection;
		const step = placing ? placing.step : store.get().shown;
		const clicks = said();
		if (!clicks.length) return;
		await check.say([{ kind: "here", step, clicks, ...(track !== null && { tracks: [track] }) }]);
		wanted = "";
		void refresh();
	}

	function cancel() {
		state.set({ placing: null });
		wanted = "";
		void refresh();
	}

	function put() {
		const now = store.get();
		handles.forEach((handle, k) => {
			const foot = feet[k];
			const cell = mosaic.children[foot?.index];
			handle.hidden = !foot || !cell;
			if (!foot || !(cell instanceof HTMLElement)) return;
			const { left, top, scale } = scaleOf(cell, foot.index, now);
			const [x, y] = [foot.x * scale - left, foot.y * scale - top];
			// A part that is magnified may not show it.
			handle.hidden = x < 0 || y < 0 || x > cell.clientWidth || y > cell.clientHeight;
			handle.style.translate = `${Math.round(mosaic.offsetLeft + cell.offsetLeft + x)}px ${Math.round(mosaic.offsetTop + cell.offsetTop + y)}px`;
			handle.classList.toggle("said", foot.said);
			handle.classList.toggle("placing", Boolean(state.get().placing));
			follow(/** @type {HTMLElement} */ (handle.firstChild), foot, scale);
		});
		if (!feet.length) {
			for (const handle of handles) handle.remove();
			handles = [];
		}
	}

	/** The box goes with its feet while they are moved. @param {HTMLElement} ghost @param {Foot} foot @param {number} scale */
	function follow(ghost, foot, scale) {
		const { selection, result } = store.get();
		const { placing } = state.get();
		const id = placing ? placing.track : selection;
		const box = result?.cameras[foot.index]?.tracks.find((track) => track.id === id)?.box;
		ghost.hidden = !foot.said || !foot.from || !box || id === null;
		if (!foot.from || !box || id === null) return;
		const [left, top, width, height] = box;
		Object.assign(ghost.style, {
			left: `${(left - foot.from[0]) * scale}px`,
			top: `${(top - foot.from[1]) * scale}px`,
			width: `${width * scale}px`,
			height: `${height * scale}px`,
		});
		ghost.style.setProperty("--c", `var(--id-${colourIndex(id)})`);
	}

	// While somebody is placed a click in a picture says where; nothing else happens there.
	for (const name of ["pointerdown", "click", "dblclick"])
		capture(mosaic, name, (event) => {
			const { placing } = state.get();
			const target = /** @type {Element} */ (event.target);
			if (!placing || target.closest(".foothold")) return;
			const at = pixelOf(/** @type {MouseEvent} */ (event), store.get());
			if (!at) return;
			event.stopPropagation();
			const foot = feet.find(({ index }) => index === at.index);
			if (name !== "click" || !foot) return;
			says(foot, at.x, at.y);
		});
	capture(document, "keydown", (event) => {
		if (!state.get().placing || store.get().place !== "check") return;
		if (document.querySelector("dialog[open], :popover-open")) return;
		const onControl = /** @type {Element} */ (event.target).closest("button, input, select");
		if (event.key === "Escape") cancel();
		else if (event.key === "Enter" && !onControl && said().length) void send();
		else return;
		claim(event);
	});
	store.on(["shown"], goAlong);
	store.watch(
		["place", "selection", "shown", "playing", "basis", "revision", "result", "cameras"],
		() => void refresh(),
	);
	let before = state.get().placing;
	state.on(["placing"], ({ placing }) => {
		begun = Boolean(placing && !before);
		before = placing;
		void refresh();
	});
	store.on(["zooms", "large", "layout"], put);
	playback.onPaint(() => handles.length && put());
	new ResizeObserver(put).observe(mosaic);
	return { send, cancel };
}
