/**
 * What a person gives the page: buttons, layer chips and keys, each a command of the one list, and
 * files that are dropped.
 */
import { capture, all, one } from "../elements/dom.js";
import { commandFor, commandOf, keyLabel, keyOf, perform } from "../state/commands.js";
import { isBench } from "../state/address.js";

/**
 * Have a button say what it would undo or redo.
 * @param {Part | HTMLButtonElement} button @param {"undo" | "redo"} name
 * @param {Server.State | null} server
 */
export function offerTurn(button, name, server) {
	const words = server?.edits[name];
	button.disabled = !words;
	button.dataset.tip = words ? `${commandOf(name).title}: ${words}` : `Nothing to ${name}`;
}

/* ---------- Where recordings come in: a key, a button, a drop. The sheet is read when wanted. */

/** @param {Context} context */
export function mountDoor(context) {
	const layer = one(".drop-layer");
	const dialog = /** @type {any} */ (one("dialog.opener"));
	/** @type {Promise<any> | undefined} */
	let sheet;
	const read = () =>
		(sheet ??= import("../opening/sheet.js").then(({ mountOpening }) => mountOpening(context)));
	/** Who asks again while it is read wants it open. @type {Promise<void> | undefined} */
	let due;
	context.actions.openSheet = () => {
		due ??= read()
			.then(({ toggle }) => toggle())
			.finally(() => (due = undefined));
	};

	// The layer lies over the 3D view, which would swallow a drop.
	const carries = (/** @type {DragEvent} */ { dataTransfer }) =>
		dataTransfer?.types.includes("Files");
	const cover = (/** @type {DragEvent} */ event) => {
		if (!carries(event)) return;
		(dialog.open ? dialog : document.body).append(layer);
		layer.hidden = false;
	};
	addEventListener("dragenter", cover);
	// A drag over the 3D view is first heard of there.
	const frame = one("iframe");
	frame.addEventListener("load", () => frame.contentDocument?.addEventListener("dragenter", cover));
	addEventListener("dragover", (event) => carries(event) && event.preventDefault());
	layer.addEventListener("dragleave", () => (layer.hidden = true));
	addEventListener("drop", (event) => {
		layer.hidden = true;
		if (!carries(event) || !event.dataTransfer) return;
		event.preventDefault();
		// They are gone as soon as the event is over.
		const entries = [...event.dataTransfer.items].map((item) => item.webkitGetAsEntry?.());
		void read().then(({ take }) => take(entries));
	});
}

/** Fields that take letters. */
const TYPING =
	"input:not([type=range], [type=checkbox], [type=color]), textarea, [contenteditable=true]";

/** What is heard while somebody types: it means nothing in a text. */
const ALWAYS = ["Ctrl+k", "Ctrl+s", "Ctrl+o"];

/**
 * Commands of keys that came before the server's first word: what they are about is not known yet.
 * @type {Command[]}
 */
const early = [];

/** What undoes and redoes. */
const TURNS = ["Ctrl+z", "Ctrl+y", "Ctrl+Shift+z"];

/** @param {Context} context */
export function mountControls({ store, actions, press }) {
	for (const control of all("[data-command], [data-command-key]")) {
		const { command: name, commandKey } = control.dataset;
		const command = commandOf(name ?? commandKey ?? "");
		control.dataset.key = command.keys.slice(0, 1).map(keyLabel).join();
		if (!name) continue;
		control.dataset.tip ??= command.title;
		if (!control.textContent?.trim()) control.ariaLabel = command.title;
		control.addEventListener("click", () => perform(command, actions));
	}
	for (const chip of all("[data-layer2d], [data-layer3d]")) {
		const { layer2d, layer3d } = chip.dataset;
		const name = layer2d ?? layer3d ?? "";
		chip.addEventListener("click", () =>
			layer2d ? actions.toggleLayer2d(name) : actions.toggleLayer3d(name),
		);
		store.watch(
			["server", "sequence", "layers2d", "layers3d", "link"],
			({ server, sequence, layers2d, layers3d, link }) => {
				chip.ariaPressed = String(Boolean((layer2d ? layers2d : layers3d)[name]));
				chip.disabled = layer2d ? !sequence : link !== "open";
				chip.disabled ||= name === "truth" && !sequence?.has_truth;
				chip.hidden = name === "pinned" && !server?.pinned;
			},
		);
	}
	store.watch(["server"], ({ server }) => {
		for (const name of /** @type {const} */ (["undo", "redo"]))
			for (const button of all(`[data-command=${name}]`)) offerTurn(button, name, server);
	});
	store.watch(["loupe", "realTime", "follow", "nearest"], (state) => {
		for (const [name, key] of /** @type {const} */ ([
			["loupe", "loupe"],
			["real-time", "realTime"],
			["nearest", "nearest"],
		]))
			for (const button of all(`[data-command=${name}]`)) button.ariaPressed = String(state[key]);
	});
	// Most of the page keeps the focus where it is when it is pressed, but who presses elsewhere is
	// done with a field.
	capture(document, "pointerdown", ({ target }) => {
		const field = /** @type {HTMLElement | null} */ (document.activeElement);
		if (field?.matches(TYPING) && target !== field) field.blur();
	});
	document.addEventListener("keydown", press);
	// What was pressed while the page was read comes first; after Ctrl K it is what is sought.
	/** @type {KeyboardEvent[]} */
	const before = /** @type {any} */ (document).takeKeys();
	const asks = before.findIndex((event) => keyOf(event) === "Ctrl+k");
	const typed = asks < 0 ? [] : before.splice(asks + 1);
	before.forEach(press);
	one(".palette input").value = typed.map(({ key }) => (key.length === 1 ? key : "")).join("");
	one(".palette").toggleAttribute("data-hasty", typed.at(-1)?.key === "Enter");
	const forget = store.on(["server"], ({ server }) => {
		if (!server) return;
		forget();
		for (const command of early.splice(0)) perform(command, actions);
	});
	// A click leaves the focus where it was, so that Space goes on meaning play, but for fields and
	// sliders; only the 3D view, which keeps all keys while it has the focus, gives it back.
	document.addEventListener("mousedown", (event) => {
		if (document.activeElement instanceof HTMLIFrameElement) document.activeElement.blur();
		const at =
			event.target instanceof Element && event.target.closest("input, select, button, tr, .cam");
		if (at && !at.matches("input:not([type=checkbox]), select")) event.preventDefault();
	});
}

/**
 * Run the command of a key, unless somebody types.
 * @param {KeyboardEvent} event
 * @param {Store<PageState>} store
 * @param {Actions} actions
 * @returns {boolean} whether there was one
 */
export function pressed(event, store, actions) {
	const key = keyOf(event);
	const target = /** @type {HTMLElement} */ (event.target);
	const open = document.querySelector("dialog[open]");
	// In a dialog a key closes it, or undoes; an import has steps of its own.
	const closes = open?.matches(".help") ? key === "?" : key === "Ctrl+k";
	const undoes = TURNS.includes(key) && !open?.matches(".opener") && !event.defaultPrevented;
	if (open && !closes && !undoes) return false;
	// An open menu is closed by it, by the browser.
	if (key === "Escape" && document.querySelector(":popover-open:not(.tip)")) return false;
	const types = target.matches?.(TYPING);
	if (types && !ALWAYS.includes(key)) return false;
	// In a list letters and arrows choose.
	if (!key.startsWith("Ctrl+") && target.matches?.("select")) return false;
	// On a focused control they press that control.
	if (key === "Enter" && target.closest?.("tr")) return false;
	if (/^(Space|Enter)$/.test(key) && target.closest?.("button, a, summary, input, [role=button]"))
		return false;
	const command = commandFor(key, store.get().singleKeys, store.get().place);
	if (!command) return false;
	// What a key means of the clock and the panes holds where they are.
	if (!isBench(store.get().place) && command.group !== "Page") return false;
	event.preventDefault();
	// What is being typed is kept first.
	if (types && key !== "Ctrl+k") target.blur();
	if (command.group !== "Page" && !store.get().server) early.push(command);
	else perform(command, actions);
	return true;
}
