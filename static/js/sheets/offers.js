/**
 * What the palette finds besides commands: places, recordings, tracks, parameters and bookmarks, by their
 * words. Nothing here touches the page but its address.
 */
import { PLACES } from "../state/places.js";

/** Offers of each kind at most: who sees as many types another word. */
const MOST = 12;

/**
 * @param {Readonly<PageState>} state
 * @param {Actions} actions
 * @param {(parameter: Server.ParameterInfo) => void} edit  asks for a parameter's value
 * @returns {Offer[]}
 */
export function offersOf(state, actions, edit) {
	const { sequences, timeline, schema, server, link, layouts, bookmarks } = state;
	const own = [
		...PLACES.filter(({ exists }) => !exists || exists(state)).map(({ name, word, tip }) => ({
			title: `${word}: ${tip[0].toLowerCase()}${tip.slice(1)}`,
			keys: [],
			run: () => (location.hash = `#${name}`),
		})),
		...Object.keys(layouts).map((name) => ({
			title: `Layout ${name}, your own`,
			keys: [],
			run: () => actions.arrange(name),
		})),
	];
	if (link !== "open") return own;
	const shown = new Set(server?.shown ?? []);
	return [
		...own,
		...(schema?.parameters ?? [])
			.filter(({ key }) => shown.has(key))
			// Of two of one name the one that the panel shows first is meant.
			.toSorted((a, b) => Number(b.essential) - Number(a.essential))
			.map((parameter) => ({
				title: `${parameter.label} ${parameter.symbol} · ${parameter.group.replace("_", " ")} = ${server?.parameters[parameter.key]}`,
				symbol: parameter.symbol,
				keys: [],
				run: () => edit(parameter),
			})),
		...sequences
			.filter(({ error }) => !error)
			.map(({ name }) => ({ title: `Open ${name}`, keys: [], run: () => void actions.open(name) })),
		...(timeline?.tracks ?? []).map(({ id, first, name }) => ({
			title: `Track ${id}${name ? `, ${name}` : ""}`,
			keys: [],
			run: () => actions.go(`${first} ${id}`),
		})),
		...bookmarks.map(({ step, note }) => ({
			title: `Bookmark ${step}${note ? `, ${note}` : ""}`,
			keys: [],
			run: () => actions.stepBy(step - state.step),
		})),
	];
}

/**
 * Those with all words of a text, some of each; without a text none.
 * @param {Offer[]} offers @param {string} text
 */
export function matching(offers, text) {
	const words = text.toLowerCase().split(/\s+/).filter(Boolean);
	if (!words.length) return [];
	/** @type {Record<string, number>} */
	const counts = {};
	return offers.filter(({ title }) => {
		const said = title.toLowerCase();
		if (!words.every((word) => said.includes(word))) return false;
		const kind = /^(Open|Track) /.exec(title)?.[1] ?? "";
		return (counts[kind] = (counts[kind] ?? 0) + 1) <= MOST;
	});
}

/**
 * The value that somebody typed for a parameter; null where it cannot be one.
 * @param {Server.ParameterInfo} parameter @param {string} text
 */
export function valueOf({ kind, minimum, maximum, choices }, text) {
	const typed = text.trim();
	if (kind === "choice") return choices.find((choice) => choice.startsWith(typed)) ?? null;
	if (kind === "bool")
		return /^(on|true|yes|1)$/i.test(typed)
			? true
			: /^(off|false|no|0)$/i.test(typed)
				? false
				: null;
	const number = typed === "" ? NaN : Number(typed.replace(",", "."));
	const fits = number >= (minimum ?? -Infinity) && number <= (maximum ?? Infinity);
	return fits && (kind !== "int" || Number.isInteger(number)) ? number : null;
}

/** What a parameter may be. @param {Server.ParameterInfo} parameter */
export const rangeOf = ({ kind, minimum, maximum, unit, choices }) =>
	kind === "choice"
		? choices.join(", ")
		: kind === "bool"
			? "on or off"
			: `${minimum} … ${maximum} ${unit}`.trim();
