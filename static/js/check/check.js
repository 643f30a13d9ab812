/** The place Check: the workbench, with the queue where the sliders stand and the tab Place. */
import { capture, one } from "../elements/dom.js";
import { OPENED_AT } from "../panes/top.js";
import { createCrops } from "./crops.js";
import { mountFeet } from "./feet.js";
import { checkOf } from "./model.js";
import { mountPlace } from "./place.js";
import { mountQueue } from "./queue.js";

/** @type {Pane} */
export function mountCheck(root, context) {
	const { store, actions } = context;
	const check = checkOf(context);
	const crops = createCrops(store);
	// Where the sliders stand.
	one(".stage").append(root);
	root.classList.add("queue");
	mountQueue(root, context, check, crops);
	mountPlace(one("#panel-place"), context, check, crops);
	mountFeet(context, check);

	// Tapped V goes there and back; what is seen while it is held down is gone with it. A key that
	// is held repeats, however long the page took for its first press.
	let held = false;
	capture(document, "keydown", (event) => {
		if (event.key !== "v" || !event.repeat || store.get().place !== "check") return;
		held = true;
		event.stopPropagation();
	});
	document.addEventListener("keyup", ({ key }) => {
		if (key !== "v" || !held) return;
		held = false;
		void actions.correct("other");
	});

	const { state } = check;
	// A link that says where it leads to is followed: nobody who came by one is led to the first place.
	let linked = OPENED_AT === "check";
	/** Whoever had a place before him finds the next one himself, as long as there are any. */
	let led = false;
	const first = () => {
		const { chosen, placing, queue } = state.get();
		led = (led || Boolean(chosen)) && queue?.doubts.length !== 0;
		if (led || (linked && store.get().moved)) return;
		// While a run goes on another may still come before it; who places somebody is not led away.
		if (store.get().place === "check" && !chosen && !placing && queue?.complete && queue.doubts[0])
			check.choose(queue.doubts[0]);
	};
	let comes = false;
	/** Who came by its word goes on in the queue, once it is there: there Enter means the place. */
	const goOn = () => {
		if (!comes) return;
		const queue = one(".qlist");
		if (document.activeElement?.matches('.place[data-go="check"]')) queue.focus();
		comes = document.activeElement?.matches('.place[data-go="check"]') ?? false;
	};
	let before = "";
	store.watch(["place"], ({ place }) => {
		linked &&= place === "check";
		if (place === "check" && before !== "check") {
			actions.showTab("place");
			comes = true;
			led = false;
			goOn();
			first();
		} else if (before === "check" && state.get().other) check.show(0);
		before = place;
	});
	state.on(["queue", "chosen"], () => (first(), goOn()));
}
