/**
 * Every command, once: `commands.json` lists them, and buttons, tooltips, keys, the help sheet,
 * the palette and the keys of the 3D view in a window of its own are made from that list.
 *
 * A key is written as `keyOf` names it: modifiers in the order Ctrl, Shift, then the key;
 * letters are lower case, and signs such as `?` stand for themselves whatever makes them.
 */

/** @type {Command[]} */
export const COMMANDS = [];

/**
 * @param {Record<Command["group"], Omit<Command, "group">[]>} groups  what `commands.json` holds
 */
export function register(groups) {
	COMMANDS.length = 0;
	for (const [group, rows] of Object.entries(groups)) {
		for (const row of rows)
			COMMANDS.push({ ...row, group: /** @type {Command["group"]} */ (group) });
	}
}

/** @param {Command} command @param {Actions} actions */
export const perform = ({ action, value }, actions) =>
	/** @type {any} */ (actions)[action](...(value === undefined ? [] : [value]));

/**
 * The name of the key that an event brings.
 * @param {{key: string, ctrlKey: boolean, metaKey: boolean, altKey: boolean, shiftKey: boolean}}
 * event
 * @returns {string} empty for a key that no command may have
 */
export function keyOf({ key, ctrlKey, metaKey, altKey, shiftKey }) {
	if (altKey || !key) return "";
	const named = key === " " ? "Space" : key;
	const single = named.length === 1;
	const letter = single && named.toLowerCase() !== named.toUpperCase();
	const shift = shiftKey && (letter || !single) ? "Shift+" : "";
	return `${ctrlKey || metaKey ? "Ctrl+" : ""}${shift}${letter ? named.toLowerCase() : named}`;
}

/** @type {Record<string, string>} */
const SIGNS = {
	ArrowLeft: "←",
	ArrowRight: "→",
	Escape: "Esc",
	PageUp: "Page ↑",
	PageDown: "Page ↓",
	"-": "−",
};

/**
 * @param {string} key  as `keyOf` names it
 * @returns {string} as a person reads it, for instance `Shift ←`
 */
export function keyLabel(key) {
	const parts = key === "+" ? [key] : key.split("+");
	return parts
		.map((part) => SIGNS[part] ?? (part.length === 1 ? part.toUpperCase() : part))
		.join(" ");
}

/** @param {string} name */
export function commandOf(name) {
	const found = COMMANDS.find((command) => command.name === name);
	if (!found) throw new Error(`there is no command ${name}; commands.json lists them all`);
	return found;
}

/**
 * The command of a key.
 * @param {string} key  as `keyOf` names it
 * @param {boolean} singleKeys  whether letters, digits and signs alone are on
 * @param {string} place  the keys of the group Check hold there alone, before those of others
 */
export function commandFor(key, singleKeys = true, place = "") {
	if (!key) return undefined;
	if (!singleKeys && key !== "?" && key.replace("Shift+", "").length === 1) return undefined;
	return COMMANDS.findLast(
		({ keys, group }) => keys.includes(key) && (group !== "Check" || place === "check"),
	);
}

/** What commands of an action are looked for by besides their words. @type {Record<string, string>} */
const ALSO = { correct: "correct correction corrections" };

/**
 * Commands whose title has all words of a text: those that begin with it first, then those that
 * have it in one piece, then those of which each word begins one.
 * @param {string} text
 */
export function search(text) {
	const words = text.toLowerCase().split(/\s+/).filter(Boolean);
	const found = COMMANDS.filter(({ title, group, action }) =>
		words.every((word) => `${title} ${group} ${ALSO[action] ?? ""}`.toLowerCase().includes(word)),
	);
	const late = (/** @type {Command} */ { title }) => {
		const own = ` ${title.toLowerCase()}`;
		const ranks = [
			own.startsWith(` ${words[0] ?? ""}`),
			own.includes(` ${words.join(" ")}`),
			words.every((word) => own.includes(` ${word}`)),
		];
		return (ranks.indexOf(true) + 4) % 4;
	};
	return found.sort((a, b) => late(a) - late(b));
}
