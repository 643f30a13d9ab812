// @ts-check
/** The side panel: tabs with a panel each. */
import { h } from "../dom.js";
import { mountChanges } from "./changes.js";
import { mountCompare } from "./compare.js";
import { mountRuns } from "./runs.js";
import { mountTracks } from "./tracks.js";

/** @type {[PageState["tab"], string][]} */
const TABS = [
	["tracks", "Tracks"],
	["changes", "Changes"],
	["compare", "Compare"],
	["runs", "Runs"],
];

/** @param {HTMLElement} root @param {Context} context */
export function mountSide(root, context) {
	const { store } = context;
	const count = h("span", { class: "count", hidden: true });
	/** @type {Record<string, {tab: HTMLButtonElement, panel: HTMLElement}>} */
	const parts = {};
	const list = h("div", { class: "tabs", role: "tablist", "aria-label": "Inspector" });
	root.append(list);
	for (const [name, word] of TABS) {
		const tab = h(
			"button",
			{ class: "tab", role: "tab", id: `tab-${name}`, "aria-controls": `panel-${name}`, onclick: () => store.set({ tab: name }) },
			word,
			name === "changes" && count,
		);
		const panel = h("div", { class: "panel", role: "tabpanel", id: `panel-${name}`, "aria-labelledby": `tab-${name}` });
		parts[name] = { tab, panel };
		list.append(tab);
		root.append(panel);
	}
	list.addEventListener("keydown", (event) => {
		if (event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
		event.preventDefault();
		event.stopPropagation();
		const names = TABS.map(([name]) => name);
		const next = names[(names.indexOf(store.get().tab) + (event.key === "ArrowRight" ? 1 : names.length - 1)) % names.length];
		store.set({ tab: next });
		parts[next].tab.focus();
	});
	mountTracks(parts.tracks.panel, context);
	mountChanges(parts.changes.panel, context);
	mountCompare(parts.compare.panel, context);
	mountRuns(parts.runs.panel, context);

	function choose() {
		const { tab: chosen } = store.get();
		for (const [name, { tab, panel }] of Object.entries(parts)) {
			tab.setAttribute("aria-selected", String(name === chosen));
			tab.tabIndex = name === chosen ? 0 : -1;
			panel.hidden = name !== chosen;
		}
	}
	store.on(["tab"], choose);
	store.on(["server"], ({ server }) => {
		const changes = server?.changed.length ?? 0;
		count.hidden = changes === 0;
		count.textContent = String(changes);
	});
	choose();
}
