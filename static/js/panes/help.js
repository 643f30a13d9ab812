// @ts-check
/** The help sheet: every command with its keys, from the one registry. */
import { COMMANDS, keyLabel } from "../commands.js";
import { h, icon } from "../dom.js";

/**
 * @param {Context} context
 * @returns {() => void} opens or closes it
 */
export function mountHelp({ store }) {
	const groups = [...new Set(COMMANDS.map((command) => command.group))];
	const rows = (/** @type {string} */ group) => {
		const commands = COMMANDS.filter((c) => c.group === group && !/^camera-[2-9]$/.test(c.name));
		return commands.map((command) => {
			const cameras = command.name === "camera-1";
			return h(
				"div",
				{ class: "key-row" },
				h("span", {}, cameras ? "Camera 1 to 9 large, again: all alike" : command.title),
				h("span", { class: "grow" }),
				cameras ? [h("kbd", {}, "1"), "–", h("kbd", {}, "9")] : command.keys.map((key) => h("kbd", {}, keyLabel(key))),
			);
		});
	};
	const single = h("input", { type: "checkbox", onchange: () => store.set({ singleKeys: single.checked }) });
	const dialog = h(
		"dialog",
		{ "aria-label": "Help and keys" },
		h(
			"div",
			{ class: "sheet-head" },
			h("h2", { class: "pane-title" }, "Help and keys"),
			h("span", { class: "grow" }),
			h("button", { class: "btn icon", "aria-label": "Close", onclick: () => dialog.close() }, icon("i-close")),
		),
		h("div", { class: "sheet" }, groups.map((group) => h("section", {}, h("h3", {}, group), rows(group)))),
		h(
			"div",
			{ class: "sheet-foot" },
			h("p", {}, "Timeline: drag to seek, wheel to zoom, Shift and wheel to move, double click for the whole. Click a box, a lane or a row to select its track."),
			h("p", {}, "Inside the 3D view arrows and W A S D move its camera; play, ends, events, cameras and layers have their keys there too."),
			h("p", {}, "Dashed always means: not seen by this run here. That is truth, and a track that coasts."),
			h("label", {}, single, "Single-key shortcuts"),
		),
	);
	dialog.addEventListener("click", (event) => {
		if (event.target === dialog) dialog.close();
	});
	document.body.append(dialog);
	return () => {
		if (dialog.open) dialog.close();
		else {
			single.checked = store.get().singleKeys;
			dialog.showModal();
		}
	};
}
