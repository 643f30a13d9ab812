/** The words of the top bar that lead from place to place. */
import { all, fill, h } from "../elements/dom.js";
import { PLACES, placeOf } from "../state/places.js";

/** @type {Pane} */
export function mountPlaces(root, { store }) {
	fill(
		root,
		PLACES.map(({ name, word, tip }) =>
			h("a", { class: "place", href: `#${name}`, "data-tip": tip, "data-go": name }, word),
		),
	);
	const follow = () => store.set({ place: placeOf(location.hash) });
	addEventListener("hashchange", follow);
	follow();
	store.watch(["place"], ({ place }) => {
		for (const link of all("[data-go]", root))
			link.ariaCurrent = link.dataset.go === place ? "page" : null;
		for (const part of all("[data-place]"))
			part.hidden = !part.dataset.place?.split(" ").includes(place);
		dispatchEvent(new Event("panes"));
	});
}
