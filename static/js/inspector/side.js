/** The side panel: tabs with a panel each. */
import { all, one, parts } from "../elements/dom.js";
import { isAlone } from "../state/events.js";
import { mountTracks } from "./tracks.js";

/** @type {Pane} */
export function mountSide(root, context) {
	const { store } = context;
	const { count, only } = parts(root);
	const tabs = all("[role=tab]", root);
	const nameOf = (/** @type {Part} */ tab) =>
		/** @type {PageState["tab"]} */ (tab.id.replace("tab-", ""));
	for (const tab of tabs) {
		tab.addEventListener("click", () => store.set({ tab: nameOf(tab) }));
		tab.addEventListener("keydown", (event) => {
			const turn = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
			if (!turn) return;
			event.preventDefault();
			event.stopPropagation();
			const there = tabs.filter(({ hidden }) => !hidden);
			const next = there[(there.indexOf(tab) + turn + there.length) % there.length];
			store.set({ tab: nameOf(next) });
			next.focus();
		});
	}
	mountTracks(one("#panel-tracks"), context);

	function choose() {
		const { tab: wanted, place } = store.get();
		for (const tab of tabs) {
			// What belongs to a place is there alone.
			if (nameOf(tab) === "place") tab.hidden = place !== "check";
			const chosen = nameOf(tab) === (wanted === "place" && place !== "check" ? "tracks" : wanted);
			tab.ariaSelected = String(chosen);
			tab.tabIndex = chosen ? 0 : -1;
			one(`#panel-${nameOf(tab)}`).hidden = !chosen;
		}
	}
	store.watch(["tab", "place"], choose);
	store.on(["layers3d", "selection"], (state) => {
		only.ariaPressed = String(isAlone(state));
		only.disabled = state.selection === null;
	});
	store.on(["server"], ({ server }) => {
		const changes = server?.changed.length ?? 0;
		count.hidden = changes === 0;
		count.textContent = String(changes);
	});
}
