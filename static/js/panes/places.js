/**
 * The words of the top bar that lead from place to place, and what they lead to. A part of the page
 * belongs to a place by its `data-place`; `bench` stands for all that are the workbench.
 */
import { all, fill, h, one, write } from "../elements/dom.js";
import { PLACES, isBench, placeOf } from "../state/places.js";

/** The place that the page was opened at. */
export const OPENED_AT = placeOf(location.hash);

/** @type {Pane} */
export function mountPlaces(root, context) {
	const { store, actions } = context;
	/** Places whose module is being read, or is there. @type {Set<string>} */
	const known = new Set();
	const links = PLACES.map(({ name, word, tip }) =>
		h(
			"a",
			{ class: "place", href: `#${name}`, "data-tip": tip, "data-go": name },
			word,
			h("span", { class: "count", hidden: true }),
		),
	);
	fill(root, links);
	const follow = () => store.set({ place: placeOf(location.hash) });
	addEventListener("hashchange", follow);
	follow();

	/** @param {PageSite} site */
	async function fillIn({ name, word, read }) {
		if (!read || known.has(name)) return;
		known.add(name);
		const part = one(`[data-place="${name}"]`);
		try {
			(await read())(part, context);
		} catch (error) {
			known.delete(name);
			actions.note("error", `${word} could not be read`, `${error}`, {
				word: "Try again",
				act: () => location.reload(),
			});
		}
	}

	for (const { name, word, read } of PLACES)
		if (read && !one(`[data-place="${name}"]`))
			one(".app").append(
				h("section", {
					class: `place-${name}`,
					"aria-label": word,
					"data-place": name,
					hidden: true,
				}),
			);
	store.watch(["place"], ({ place }) => {
		PLACES.forEach((site, k) => {
			links[k].ariaCurrent = site.name === place ? "page" : null;
			if (site.name === place) void fillIn(site);
		});
		one(".app").classList.toggle("away", !isBench(place));
		one(".app").dataset.at = place;
		for (const part of all("[data-place]"))
			part.hidden =
				part.dataset.place !== (part.dataset.place === "bench" && isBench(place) ? "bench" : place);
		dispatchEvent(new Event("panes"));
	});
	store.watch(["place", "server", "run", "timeline", "signs"], (state) =>
		PLACES.forEach(({ name, exists, sign }, k) => {
			// Who is there by the address stays there.
			links[k].hidden = Boolean(exists && !exists(state) && state.place !== name);
			const count = /** @type {HTMLElement} */ (links[k].lastChild);
			write(count, sign?.(state) ?? state.signs[name] ?? "");
			count.hidden = !count.textContent;
		}),
	);
}
