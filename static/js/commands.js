// @ts-check
/**
 * Every command of the page, once. Keys, tooltips, the help sheet and the commands that
 * arrive from the 3D view are all made from this list.
 *
 * A key is written as `keyOf` names it: modifiers in the order Ctrl, Shift, then the key;
 * letters are lower case, and signs such as `?` stand for themselves whatever makes them.
 */

/**
 * Name, title, keys, what it does.
 * @type {Record<Command["group"], [string, string, string[], (actions: Actions) => void][]>}
 */
const TABLE = {
	Play: [
		["play", "Play or pause", ["Space"], (a) => a.togglePlay()],
		["step-back", "One step back", ["ArrowLeft", ","], (a) => a.stepBy(-1)],
		["step-forward", "One step on", ["ArrowRight", "."], (a) => a.stepBy(1)],
		["second-back", "One second back", ["Shift+ArrowLeft"], (a) => a.seekBy(-1)],
		["second-forward", "One second on", ["Shift+ArrowRight"], (a) => a.seekBy(1)],
		["ten-back", "Ten steps back", ["PageUp"], (a) => a.stepBy(-10)],
		["ten-forward", "Ten steps on", ["PageDown"], (a) => a.stepBy(10)],
		["first", "First step", ["Home"], (a) => a.toEnd("first")],
		["last", "Last step", ["End"], (a) => a.toEnd("last")],
		["play-back", "Play backwards, again: faster", ["j"], (a) => a.shuttle(-1)],
		["stop", "Stop", ["k"], (a) => a.shuttle(0)],
		["play-forward", "Play, again: faster", ["l"], (a) => a.shuttle(1)],
		["slower", "Slower", ["-"], (a) => a.changeSpeed(-1)],
		["faster", "Faster", ["="], (a) => a.changeSpeed(1)],
		["mark-in", "Play from here", ["i"], (a) => a.markRange(0)],
		["mark-out", "Play to here", ["o"], (a) => a.markRange(1)],
		["loop", "Loop", ["\\"], (a) => a.toggleLoop()],
	],
	Tracks: [
		["next-event", "Next birth, death, switch or long miss", ["n"], (a) => a.toEvent(1)],
		["previous-event", "Previous birth, death, switch or long miss", ["Shift+n"], (a) => a.toEvent(-1)],
		["previous-track", "Previous track", ["["], (a) => a.nextTrack(-1)],
		["next-track", "Next track", ["]"], (a) => a.nextTrack(1)],
		["clear", "Clear the selection", ["Escape"], (a) => a.clear()],
		["export", "Export the tracks as CSV", ["Ctrl+e"], (a) => a.exportTracks()],
	],
	"Cameras and 3D": [
		...Array.from({ length: 9 }, (_, index) => {
			const run = (/** @type {Actions} */ a) => a.chooseCamera(index);
			return /** @type {[string, string, string[], typeof run]} */ ([`camera-${index + 1}`, `Camera ${index + 1} large`, [String(index + 1)], run]);
		}),
		["free-view", "Free view, cameras alike", ["0"], (a) => a.freeView()],
		["truth", "Truth on or off", ["g"], (a) => a.toggleLayer("truth")],
		["trails", "Trails on or off", ["t"], (a) => a.toggleLayer("trails")],
		["detections", "Detections on or off", ["d"], (a) => a.toggleLayer("measurements")],
		["estimates", "2D estimates on or off", ["e"], (a) => a.toggleLayer("estimates")],
		["boxes", "Reprojected boxes on or off", ["b"], (a) => a.toggleLayer("boxes")],
		["samples", "Samples on or off", ["s"], (a) => a.toggleLayer("samples")],
	],
	Page: [
		["undo", "Undo the last change of parameters", ["Ctrl+z"], (a) => a.undo()],
		["theme", "Dark or light", ["Shift+d"], (a) => a.toggleTheme()],
		["help", "Help and keys", ["?"], (a) => a.help()],
	],
};

/** @type {Command[]} */
export const COMMANDS = Object.entries(TABLE).flatMap(([group, rows]) =>
	rows.map(([name, title, keys, run]) => ({ name, title, keys, run, group: /** @type {Command["group"]} */ (group) })),
);

/**
 * The name of the key that an event brings.
 * @param {{key: string, ctrlKey: boolean, metaKey: boolean, altKey: boolean, shiftKey: boolean}} event
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
const SIGNS = { ArrowLeft: "←", ArrowRight: "→", Escape: "Esc", PageUp: "Page ↑", PageDown: "Page ↓", "-": "−" };

/**
 * @param {string} key  as `keyOf` names it
 * @returns {string} as a person reads it, for instance `Shift ←`
 */
export function keyLabel(key) {
	const parts = key === "+" ? [key] : key.split("+");
	return parts.map((part) => SIGNS[part] ?? (part.length === 1 ? part.toUpperCase() : part)).join(" ");
}

/** @param {string} name */
export function commandOf(name) {
	const found = COMMANDS.find((command) => command.name === name);
	if (!found) throw new Error(`there is no command ${name}; commands.js lists them all`);
	return found;
}

/**
 * The command of a key.
 * @param {string} key  as `keyOf` names it
 * @param {boolean} singleKeys  whether keys without Ctrl are on
 */
export function commandFor(key, singleKeys = true) {
	if (!key) return undefined;
	if (!singleKeys && key.length === 1 && key !== "?") return undefined;
	return COMMANDS.find((command) => command.keys.includes(key));
}

/**
 * Keys that more than one command claims.
 * @param {Command[]} commands
 */
export function clashes(commands) {
	const all = commands.flatMap((command) => command.keys);
	return all.filter((key, index) => all.indexOf(key) !== index);
}
