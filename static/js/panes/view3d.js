// @ts-check
/** The 3D pane: viser's page inside ours, with its layers and view points. */
import { fill, h, icon, tipOf } from "../dom.js";

/** @type {[string, string, string, string][]} layer, word, sign, tip */
const LAYERS = [
	["boxes", "boxes", "l-cube", "Upright boxes of the estimates"],
	["ellipsoids", "ellipsoids", "l-oval", "Gaussian components; opacity is weight"],
	["trails", "trails", "l-trail", "Where the estimates came from"],
	["truth", "truth", "l-dash", "Where people really are"],
	["volume", "volume", "l-vol", "Tracked volume and entrances"],
];

/** @param {HTMLElement} root @param {Context} context */
export function mountView3d(root, { store, page, retry }) {
	/** @type {Record<string, HTMLButtonElement>} */
	const chips = {};
	for (const [layer, word, sign, tip] of LAYERS) {
		const key = layer === "truth" || layer === "trails" ? tipOf(layer)["data-key"] : "";
		chips[layer] = h(
			"button",
			{ class: "chip end", "data-tip": tip, "data-key": key, onclick: () => page.toggleLayer3d(layer) },
			icon(sign, "", "0 0 14 10"),
			h("span", {}, word),
		);
	}
	const views = h("div", { class: "seg", role: "group", "aria-label": "View point" });
	const frame = h("iframe", { title: "3D view of the room, with the parameters' sliders", allow: "fullscreen" });
	const blank = h("div", { class: "blank" });
	root.append(
		h(
			"div",
			{ class: "pane-head" },
			h("h2", { class: "pane-title" }, "3D"),
			views,
			h("span", { class: "grow" }),
			h("div", { class: "chips", role: "group", "aria-label": "Layers in 3D" }, Object.values(chips)),
		),
		h("div", { class: "stage" }, frame, blank),
	);

	let path = "";
	let reachable = false;
	let tries = 0;
	/** @type {ReturnType<typeof setTimeout> | undefined} */
	let timer;

	/** Load viser's page, but only once it answers: a browser's error page inside ours says nothing. */
	async function load() {
		clearTimeout(timer);
		if (!path) return;
		try {
			const answer = await fetch(path, { cache: "no-store" });
			reachable = answer.ok;
		} catch {
			reachable = false;
		}
		if (reachable) {
			tries = 0;
			frame.src = path;
		} else {
			tries += 1;
			if (store.get().link === "open") timer = setTimeout(load, Math.min(8000, 1000 * 2 ** tries));
		}
		cover();
	}

	function cover() {
		const { link, server } = store.get();
		blank.hidden = reachable && link !== "lost";
		if (blank.hidden) return;
		if (link === "lost") {
			fill(blank, icon("i-plug", "l"), h("h3", {}, "3D view lost"), h("p", {}, "Pictures and results that were loaded can still be looked at."), h("button", { class: "btn box", onclick: retry }, "Try now"));
		} else if (tries > 0) {
			fill(blank, icon("i-plug", "l"), h("h3", {}, "The 3D view does not answer"), h("p", {}, "Pictures, timeline and tables still work. It is tried again by itself."), h("button", { class: "btn box", onclick: load }, "Try now"));
		} else fill(blank, h("p", {}, server ? "Loading the 3D view" : "Connecting"));
	}

	function header() {
		const { server, layers3d, view3d, link } = store.get();
		const sequence = server?.sequence;
		for (const [layer] of LAYERS) chips[layer].setAttribute("aria-pressed", String(Boolean(layers3d[layer])));
		for (const [layer, chip] of Object.entries(chips)) {
			chip.toggleAttribute("disabled", link !== "open" || (layer === "truth" && !sequence?.has_truth));
		}
		const names = ["free", ...(sequence?.cameras ?? []).map((_, index) => `C${index + 1}`)];
		if (views.childElementCount !== names.length) {
			fill(
				views,
				names.map((name, index) =>
					h(
						"button",
						{
							class: "start",
							"data-tip": index ? `Look through ${sequence?.cameras[index - 1].name}` : "Free view",
							"data-key": index ? "" : "0",
							onclick: () => page.chooseView(index - 1),
						},
						name,
					),
				),
			);
		}
		[...views.children].forEach((button, index) => {
			button.setAttribute("aria-pressed", String(index - 1 === view3d));
			button.toggleAttribute("disabled", link !== "open");
		});
	}

	store.on(["server"], ({ server }) => {
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
	store.on(["layers3d", "view3d", "link"], header);
	header();
	cover();
}
