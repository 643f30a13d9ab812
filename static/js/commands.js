// @ts-check
/**
 * Every command of the page, once. Keys, tooltips, the help sheet and the commands that
 * arrive from the 3D view are all made from this list.
 *
 * A key is written as `keyOf` names it: modifiers in the order Ctrl, Shift, then the key;
 * letters are lower case, and signs such as `?` stand for themselves whatever makes them.
 *
 * @typedef {object} Command
 * @property {string} name
 * @property {string} title
 * @property {"Play" | "Cameras and 3D" | "Tracks" | "Page"} group
 * @property {string[]} keys
 * @property {(actions: Actions) => void} run
 *
 * @typedef {object} Actions  what commands need of the page
 * @property {() => void} togglePlay
 * @property {(direction: -1 | 0 | 1) => void} shuttle
 * @property {(steps: number) => void} stepBy
 * @property {(seconds: number) => void} seekBy
 * @property {(end: "first" | "last") => void} toEnd
 * @property {(direction: -1 | 1) => void} changeSpeed
 * @property {() => void} toggleLoop
 * @property {(end: 0 | 1) => void} markRange
 * @property {(direction: -1 | 1) => void} toEvent
 * @property {(direction: -1 | 1) => void} nextTrack
 * @property {(index: number) => void} chooseCamera
 * @property {() => void} freeView
 * @property {(layer: string) => void} toggleLayer
 * @property {() => void} clear
 * @property {() => void} exportTracks
 * @property {() => void} toggleTheme
 * @property {() => void} help
 * @property {() => void} undo
 */

/** @type {Command[]} */
export const COMMANDS = [
  { name: "play", title: "Play or pause", group: "Play", keys: ["Space"], run: (a) => a.togglePlay() },
  { name: "step-back", title: "One step back", group: "Play", keys: ["ArrowLeft", ","], run: (a) => a.stepBy(-1) },
  { name: "step-forward", title: "One step on", group: "Play", keys: ["ArrowRight", "."], run: (a) => a.stepBy(1) },
  { name: "second-back", title: "One second back", group: "Play", keys: ["Shift+ArrowLeft"], run: (a) => a.seekBy(-1) },
  { name: "second-forward", title: "One second on", group: "Play", keys: ["Shift+ArrowRight"], run: (a) => a.seekBy(1) },
  { name: "ten-back", title: "Ten steps back", group: "Play", keys: ["PageUp"], run: (a) => a.stepBy(-10) },
  { name: "ten-forward", title: "Ten steps on", group: "Play", keys: ["PageDown"], run: (a) => a.stepBy(10) },
  { name: "first", title: "First step", group: "Play", keys: ["Home"], run: (a) => a.toEnd("first") },
  { name: "last", title: "Last step", group: "Play", keys: ["End"], run: (a) => a.toEnd("last") },
  { name: "play-back", title: "Play backwards, again: faster", group: "Play", keys: ["j"], run: (a) => a.shuttle(-1) },
  { name: "stop", title: "Stop", group: "Play", keys: ["k"], run: (a) => a.shuttle(0) },
  { name: "play-forward", title: "Play, again: faster", group: "Play", keys: ["l"], run: (a) => a.shuttle(1) },
  { name: "slower", title: "Slower", group: "Play", keys: ["-"], run: (a) => a.changeSpeed(-1) },
  { name: "faster", title: "Faster", group: "Play", keys: ["="], run: (a) => a.changeSpeed(1) },
  { name: "mark-in", title: "Play from here", group: "Play", keys: ["i"], run: (a) => a.markRange(0) },
  { name: "mark-out", title: "Play to here", group: "Play", keys: ["o"], run: (a) => a.markRange(1) },
  { name: "loop", title: "Loop", group: "Play", keys: ["\\"], run: (a) => a.toggleLoop() },
  { name: "next-event", title: "Next birth, death or long miss", group: "Tracks", keys: ["n"], run: (a) => a.toEvent(1) },
  { name: "previous-event", title: "Previous birth, death or long miss", group: "Tracks", keys: ["Shift+n"], run: (a) => a.toEvent(-1) },
  { name: "previous-track", title: "Previous track", group: "Tracks", keys: ["["], run: (a) => a.nextTrack(-1) },
  { name: "next-track", title: "Next track", group: "Tracks", keys: ["]"], run: (a) => a.nextTrack(1) },
  { name: "clear", title: "Clear the selection", group: "Tracks", keys: ["Escape"], run: (a) => a.clear() },
  { name: "export", title: "Export the tracks as CSV", group: "Tracks", keys: ["Ctrl+e"], run: (a) => a.exportTracks() },
  ...Array.from({ length: 9 }, (_, index) => ({
    name: `camera-${index + 1}`,
    title: `Camera ${index + 1} large`,
    group: /** @type {const} */ ("Cameras and 3D"),
    keys: [String(index + 1)],
    run: (/** @type {Actions} */ a) => a.chooseCamera(index),
  })),
  { name: "free-view", title: "Free view, cameras alike", group: "Cameras and 3D", keys: ["0"], run: (a) => a.freeView() },
  { name: "truth", title: "Truth on or off", group: "Cameras and 3D", keys: ["g"], run: (a) => a.toggleLayer("truth") },
  { name: "trails", title: "Trails on or off", group: "Cameras and 3D", keys: ["t"], run: (a) => a.toggleLayer("trails") },
  { name: "detections", title: "Detections on or off", group: "Cameras and 3D", keys: ["d"], run: (a) => a.toggleLayer("measurements") },
  { name: "estimates", title: "2D estimates on or off", group: "Cameras and 3D", keys: ["e"], run: (a) => a.toggleLayer("estimates") },
  { name: "boxes", title: "Reprojected boxes on or off", group: "Cameras and 3D", keys: ["b"], run: (a) => a.toggleLayer("boxes") },
  { name: "samples", title: "Samples on or off", group: "Cameras and 3D", keys: ["s"], run: (a) => a.toggleLayer("samples") },
  { name: "undo", title: "Undo the last change of parameters", group: "Page", keys: ["Ctrl+z"], run: (a) => a.undo() },
  { name: "theme", title: "Dark or light", group: "Page", keys: ["Shift+d"], run: (a) => a.toggleTheme() },
  { name: "help", title: "Help and keys", group: "Page", keys: ["?"], run: (a) => a.help() },
];

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
 * @returns {Command | undefined}
 */
export function commandFor(key, singleKeys = true) {
  if (!key) return undefined;
  if (!singleKeys && key.length === 1 && key !== "?") return undefined;
  return COMMANDS.find((command) => command.keys.includes(key));
}

/**
 * Keys that more than one command claims.
 * @param {Command[]} commands
 * @returns {string[]}
 */
export function clashes(commands) {
  const all = commands.flatMap((command) => command.keys);
  return all.filter((key, index) => all.indexOf(key) !== index);
}
