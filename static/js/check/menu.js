/** The menu of corrections at a lane, a box or the selected person; with whom; and a name. */
import { fill, h, icon, idTag, one } from "../elements/dom.js";
import { whenHeld } from "../elements/held.js";
import { resultOf } from "../state/events.js";
import { commandOf, keyLabel, perform } from "../state/commands.js";
import { clickOf, pixelOf } from "./feet.js";
import { checkOf } from "./model.js";
import { exchangeable, joinable, whereIs } from "./words.js";

/** What the menu has for a track, in its order: a command, its sign, and what it says. */
const ITEMS = /** @type {const} */ ([
	["check-exchange", "i-exchange", "Exchange with…"],
	["check-split", "i-split", "Split here"],
	["check-join", "i-join", "Join with…"],
	["check-here", "i-here", "Say where it is…"],
	["check-came", "i-start", "Came in here"],
	["check-left", "i-end", "Left here"],
	["check-name", "i-name", "Name…"],
	["check-nobody", "i-trash", "Was nobody"],
]);

/** A button is let go where it was pressed, CSS pixels. */
const STILL = 4;

/** Others that are listed. */
const MOST = 12;

/**
 * @param {Context} context
 * @param {TimelineSeam} timeline
 * @param {object} does
 * @param {(one: number, other: number) => any} does.exchange
 * @param {(one: number, other: number) => any} does.join
 * @param {(track: number, name: string) => any} does.name
 */
export function mountMenu(context, timeline, does) {
	const { store, actions } = context;
	const { state } = checkOf(context);
	const menu = h("div", { class: "menu corrects", popover: "auto" });
	one("main").append(menu);
	/** Whoever is chosen elsewhere while others are offered is taken. @type {((id: number) => void) | null} */
	let takes = null;
	/** Where it was opened. */
	let [left, top] = [0, 0];

	/** @param {string} label @param {Child[]} head @param {"menu" | "group"} role @param {Child[]} children */
	function show(label, head, role, ...children) {
		fill(
			menu,
			h("p", { class: "menu-head" }, ...head),
			h("div", { role, "aria-label": label }, ...children),
		);
		if (!menu.matches(":popover-open")) menu.showPopover();
		const box = menu.getBoundingClientRect();
		menu.style.left = `${Math.max(4, Math.min(left, innerWidth - box.width - 4))}px`;
		menu.style.top = `${Math.max(4, Math.min(top, innerHeight - box.height - 4))}px`;
		/** @type {HTMLElement | null} */ (menu.querySelector("button, input"))?.focus();
	}
	const close = () => menu.matches(":popover-open") && menu.hidePopover();
	menu.addEventListener("toggle", (event) => {
		if (/** @type {ToggleEvent} */ (event).newState !== "open") takes = null;
	});
	menu.addEventListener("keydown", (event) => {
		const turn = { ArrowDown: 1, ArrowUp: -1 }[event.key];
		if (turn) {
			const all = [...menu.querySelectorAll("button")];
			const at = all.indexOf(/** @type {HTMLButtonElement} */ (document.activeElement));
			all[(at + turn + all.length) % all.length]?.focus();
			event.preventDefault();
		}
		// Its keys are its own: the page's mean something else.
		if (event.key !== "Escape") event.stopPropagation();
	});

	/** @param {string} sign @param {Child[]} words @param {string} key @param {() => void} act */
	const item = (sign, words, key, act) =>
		h(
			"button",
			{ role: "menuitem", onclick: () => (close(), act()) },
			icon(sign),
			h("span", {}, ...words),
			key && h("kbd", {}, key),
		);

	/** @param {{track: number | null, step: number, click?: Spot}} what */
	function open({ track, step, click }) {
		if (track !== null) actions.select(track);
		if (click) store.set({ playing: 0 });
		const { told } = state.get();
		const at = (/** @type {string} */ name) =>
			commandOf(name).keys.slice(0, 1).map(keyLabel).join();
		show(
			track === null
				? `Corrections at step ${step}`
				: `Corrections of track ${track} at step ${step}`,
			[
				track === null ? "nobody" : idTag(track),
				track !== null && told?.names[track],
				h("span", { class: "sub" }, `step ${step}`),
			],
			"menu",
			...(track === null
				? []
				: ITEMS.map(([name, sign, words]) =>
						item(sign, [words], at(name), () => perform(commandOf(name), actions)),
					)),
			click &&
				item("i-here", [track === null ? "Somebody is here" : "Its feet are here"], "", () =>
					checkOf(context).say([
						{
							kind: "here",
							step,
							clicks: [clickOf(click)],
							...(track !== null && { tracks: [track] }),
						},
					]),
				),
			told?.undo && item("i-undo", [`Undo: ${told.undo}`], "", () => actions.correct("undo")),
		);
	}

	/**
	 * With whom: to exchange those who are there, the nearest first; to join first those that come
	 * before or after. A click on anybody else is an answer too.
	 * @param {"exchange" | "join"} what @param {number} track
	 */
	function others(what, track) {
		const { timeline: lanes, shown, names } = store.get();
		const joins = what === "join";
		const step = Math.max(0, shown);
		const among = /** @type {const} */ ([track, resultOf(store.get()), lanes?.tracks ?? [], step]);
		const { found, why } = joins
			? { found: joinable(...among), why: "It takes a second track." }
			: exchangeable(...among);
		if (!found.length)
			return actions.note("info", `Nobody to ${joins ? "join" : "exchange"} ${track} with`, why);
		if (!menu.matches(":popover-open")) middle();
		const word = joins ? "Join" : "Exchange";
		const take = (/** @type {number} */ id) => (close(), void does[what](track, id));
		const own = lanes?.tracks.find(({ id }) => id === track);
		const ends = found.some((other) => "pause" in other && other.pause);
		show(
			`${word} ${track} with`,
			[
				`${word} `,
				idTag(track),
				" with",
				joins &&
					own &&
					!ends &&
					h(
						"span",
						{ class: "sub alone" },
						`nobody comes before step ${own.first} or after step ${own.last}; ` +
							`of two who are there at once it is said from step ${step} on`,
					),
			],
			"menu",
			...found
				.slice(0, MOST)
				.map((other) =>
					item(
						joins ? "i-join" : "i-exchange",
						[
							idTag(other.id),
							names[other.id] && ` ${names[other.id]}`,
							h("span", { class: "sub" }, ` ${whereIs(other, step, own)}`),
						],
						"",
						() => take(other.id),
					),
				),
		);
		takes = (id) => {
			if (id !== track && (joins || found.some((other) => other.id === id))) return take(id);
			const { why: not } = exchangeable(id, null, lanes?.tracks ?? [], step);
			if (id !== track) actions.note("info", `${id} cannot be exchanged with ${track}`, not);
		};
	}

	/** @param {number} track */
	function name(track) {
		middle();
		const given = state.get().told?.names[track] ?? "";
		const field = h("input", {
			class: "field",
			value: given,
			maxlength: 80,
			"aria-label": `Name of track ${track}`,
			placeholder: "name, then Enter",
		});
		field.addEventListener("keydown", ({ key }) => {
			if (key !== "Enter" || !field.value.trim()) return;
			close();
			void does.name(track, field.value.trim());
		});
		show(`Name of track ${track}`, [idTag(track), " is"], "group", field);
		field.select();
	}

	/** Over the cameras, where no pointer says better. */
	function middle() {
		const box = one(".side").getBoundingClientRect();
		[left, top] = [box.left + 12, box.top + 12];
	}

	store.on(["selection"], ({ selection }) => {
		if (takes && selection !== null) takes(selection);
	});
	/** @param {MouseEvent} event @param {{track: number | null, step: number, click?: Spot}} what */
	function at(event, what) {
		if (!store.get().sequence) return;
		event.preventDefault();
		[left, top] = [event.clientX + 2, event.clientY + 2];
		open(what);
		// What stood beside the pointer would lie under the menu.
		store.set({ hover: null, pointed: null });
	}
	const shown = () => Math.max(0, store.get().shown);
	/** By the other button, or by a finger or a pen that is held. */
	/** @param {HTMLElement} element @param {(event: MouseEvent) => void} ask */
	function asked(element, ask) {
		element.addEventListener("contextmenu", ask);
		whenHeld(element, ask);
	}
	asked(timeline.plot, (event) => {
		const { step, track } = timeline.at(/** @type {PointerEvent} */ (event));
		if (!track) return;
		context.playback.seek(step);
		at(event, { track: track.id, step });
	});
	asked(one(".lanes"), (event) => {
		const label = /** @type {HTMLElement} */ (event.target).closest(".lane");
		const id = Number(label?.querySelector(".id")?.textContent);
		if (id) at(event, { track: id, step: shown() });
	});
	asked(one(".mosaic"), (event) => {
		const click = pixelOf(event, store.get());
		if (!click || one(".mosaic").classList.contains("drawing")) return;
		const { hover } = store.get();
		at(event, {
			track: hover?.camera === click.index ? hover.id : null,
			step: shown(),
			click,
		});
	});
	const frame = /** @type {HTMLIFrameElement} */ (one(".stage iframe"));
	/** In 3D the other button moves the view; pressed and let go in place it asks. */
	function in3d() {
		/** @type {[number, number] | null} */
		let pressed = null;
		const view = frame.contentWindow;
		view?.addEventListener(
			"pointerdown",
			({ button, clientX, clientY }) => (pressed = button === 2 ? [clientX, clientY] : null),
			true,
		);
		view?.addEventListener(
			"pointerup",
			(event) => {
				if (event.button !== 2 || !pressed || !store.get().sequence) return;
				const [x, y] = [event.clientX - pressed[0], event.clientY - pressed[1]];
				if (Math.hypot(x, y) > STILL) return;
				const { selection } = store.get();
				if (selection === null)
					return actions.note("info", "Nobody is selected", "Click on somebody, then press again.");
				const edge = frame.getBoundingClientRect();
				[left, top] = [edge.left + event.clientX + 2, edge.top + event.clientY + 2];
				open({ track: selection, step: shown() });
			},
			true,
		);
	}
	frame.addEventListener("load", in3d);
	// It may have been there before this was read.
	in3d();
	return {
		/** @param {{track: number, step: number}} what */
		open(what) {
			middle();
			open(what);
		},
		others,
		name,
	};
}
