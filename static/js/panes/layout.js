/** How much room each pane has: dragged or moved by key, one pane alone, remembered. */
import { claim, all, one } from "../elements/dom.js";

/** What a splitter sets, which way it grows, and its least and largest share of the window. */
const SPLITS = {
	right: { size: "--w-right", along: "x", sign: -1, least: 0.25, most: 0.65 },
	cams: { size: "--h-cams", along: "y", sign: 1, least: 0.12, most: 0.62 },
	lanes: { size: "--h-lanes", along: "y", sign: -1, least: 0.04, most: 0.5 },
};

/** @param {Context} context */
export function mountLayout({ store, actions }) {
	const app = one(".app");
	const splits = all("[data-split]");
	const nameOf = (/** @type {Part} */ split) =>
		/** @type {keyof typeof SPLITS} */ (split.dataset.split);
	const windowOf = (/** @type {string} */ along) => (along === "x" ? innerWidth : innerHeight);

	/** What a splitter stands at now, pixels. @param {keyof typeof SPLITS} name */
	function now(name) {
		const pane = one({ right: ".side", cams: ".cams", lanes: ".lanes" }[name]);
		return SPLITS[name].along === "x" ? pane.offsetWidth : pane.offsetHeight;
	}

	/** @param {keyof typeof SPLITS} name @param {number} pixels */
	function resize(name, pixels) {
		const { along, least, most } = SPLITS[name];
		const share = Math.max(least, Math.min(most, pixels / windowOf(along)));
		store.set({ layout: { ...store.get().layout, [name]: share, max: undefined } });
	}

	for (const split of splits) {
		const name = nameOf(split);
		const { along, sign } = SPLITS[name];
		const place = (/** @type {PointerEvent} */ event) =>
			along === "x" ? event.clientX : event.clientY;
		/** @type {[number, number] | null} */
		let begun = null;
		split.addEventListener("pointerdown", (event) => {
			event.preventDefault();
			split.setPointerCapture(event.pointerId);
			begun = [place(event), now(name)];
			app.classList.add("dragging");
		});
		split.addEventListener(
			"pointermove",
			(event) => begun && resize(name, begun[1] + sign * (place(event) - begun[0])),
		);
		split.addEventListener("lostpointercapture", () => {
			begun = null;
			app.classList.remove("dragging");
		});
		split.addEventListener("dblclick", () =>
			store.set({ layout: { ...store.get().layout, [name]: undefined } }),
		);
		split.addEventListener("keydown", (event) => {
			const turn =
				(along === "x" ? ["ArrowLeft", "", "ArrowRight"] : ["ArrowUp", "", "ArrowDown"]).indexOf(
					event.key,
				) - 1;
			if (turn !== -1 && turn !== 1) return;
			claim(event);
			resize(name, now(name) + sign * turn * (event.shiftKey ? 80 : 16));
		});
	}
	for (const pane of /** @type {const} */ (["view", "cams", "side", "time"])) {
		document
			.querySelector(`.${pane} > :first-child`)
			?.addEventListener("dblclick", ({ target }) => {
				if (target instanceof Element && !target.closest("button, input, select, .chooser, .read"))
					actions.maximise(pane);
			});
	}

	function arrange() {
		const { layout } = store.get();
		for (const [name, { size, along }] of Object.entries(SPLITS)) {
			const share = layout[/** @type {keyof typeof SPLITS} */ (name)];
			if (share) app.style.setProperty(size, `${Math.round(share * windowOf(along))}px`);
			else app.style.removeProperty(size);
		}
		app.dataset.max = layout.max ?? "";
		// A 3D view that had the keys and is now hidden would keep them.
		if (!document.activeElement?.checkVisibility())
			/** @type {HTMLElement | null} */ (document.activeElement)?.blur();
		for (const button of all("[data-command^=maximise]"))
			button.ariaPressed = String(button.dataset.command === `maximise-${layout.max}`);
		for (const split of splits) {
			const name = nameOf(split);
			split.ariaValueNow = String(Math.round((100 * now(name)) / windowOf(SPLITS[name].along)));
		}
		// Canvases measure themselves anew.
		dispatchEvent(new Event("panes"));
	}
	store.watch(["layout"], arrange);
	addEventListener("resize", arrange);
}
