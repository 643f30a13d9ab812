/** What can be said to put tracks right: one function for each command, at every place of the bench. */
import { capture, all, fill, h, icon, idTag, one, turned } from "../elements/dom.js";
import { menuOf } from "../elements/over.js";
import { commandOf, keyLabel, perform } from "../state/commands.js";
import { resultOf } from "../state/events.js";
import { lensOf } from "../draw/overlay.js";
import { mountMarks } from "./marks.js";
import { checkOf } from "./model.js";
import {
	distinct,
	filmSteps,
	isOfTwo,
	nextCrossing,
	otherOf,
	proposed,
	exchangeable,
	joinable,
	whereIs,
} from "./words.js";

/* ---------- A finger or a pen that is held still asks for what the other button of a mouse asks
   for: not every browser says so by itself. */

/** Held for so long, milliseconds, and moved by no more than so much, CSS pixels. */
const [HELD_MS, HELD_STILL] = [550, 8];

/** Letting go may be followed by a click; where it was not by then there is none, milliseconds. */
const AFTER_MS = 300;

/**
 * @param {HTMLElement} element
 * @param {(event: PointerEvent) => void} act  for where it was pressed; once when it was held long
 * enough, and once more when it is let go, since letting go closes what opened meanwhile
 */
function whenHeld(element, act) {
	/** @type {PointerEvent | null} */
	let pressed = null;
	let held = false;
	/** @type {Timer} */
	let timer;
	const end = () => clearTimeout(timer);
	capture(element, "pointerdown", (event) => {
		end();
		held = false;
		if (event.pointerType === "mouse" || !event.isPrimary || event.button !== 0) return;
		pressed = event;
		timer = setTimeout(() => {
			held = true;
			act(event);
		}, HELD_MS);
	});
	capture(element, "pointermove", ({ clientX, clientY }) => {
		const far = pressed && Math.hypot(clientX - pressed.clientX, clientY - pressed.clientY);
		if (far && far > HELD_STILL) end();
	});
	for (const kind of ["pointerup", "pointercancel", "contextmenu"]) capture(element, kind, end);
	element.addEventListener("pointerup", () => {
		const again = held ? pressed : null;
		if (again) timer = setTimeout(() => act(again), AFTER_MS);
	});
	// What ends it is no click, and closes what opened as one beside it would.
	capture(element, "click", (event) => {
		const again = held ? pressed : null;
		if (!again) return;
		held = false;
		event.stopImmediatePropagation();
		event.preventDefault();
		end();
		setTimeout(() => act(again));
	});
}

/* ---------- Where in a picture somebody points. */

/** How a cell shows its picture. @param {Element} cell @param {number} camera @param {Readonly<PageState>} state */
export function scaleOf(cell, camera, { zooms, cameras }) {
	const { clientWidth: width, clientHeight: height } = cell;
	const lens = lensOf(zooms[camera], width, height);
	return { ...lens, scale: (width * lens.k) / cameras[camera].width };
}

/**
 * The pixel under the pointer, and of which camera.
 * @param {MouseEvent} event @param {Readonly<PageState>} state
 * @param {Element | null} cell  that is meant, where it is not under the pointer
 * @returns {Spot | null}
 */
export function pixelOf(
	{ target, clientX, clientY },
	state,
	cell = /** @type {Element} */ (target).closest(".cam"),
) {
	const index = cell ? [...one(".mosaic").children].indexOf(cell) : -1;
	if (!cell || !state.cameras[index]) return null;
	const edge = cell.getBoundingClientRect();
	const { left, top, scale } = scaleOf(cell, index, state);
	return {
		index,
		camera: state.cameras[index].name,
		x: (clientX - edge.left + left) / scale,
		y: (clientY - edge.top + top) / scale,
	};
}

/** As it is said. @param {Spot} spot @returns {Click} */
export const clickOf = ({ camera, x, y }) => ({ camera, x, y });

/* ---------- The menu of corrections at a lane, a box or the selected person; with whom; and a
   name. */

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
function mountMenu(context, timeline, does) {
	const { store, actions } = context;
	const { state } = checkOf(context);
	const menu = menuOf({ class: "menu corrects" });
	one("main").append(menu);
	/** Whoever is chosen elsewhere while others are offered is taken. @type {((id: number) => void) | null} */
	let takes = null;
	/** Where it was opened. */
	let [left, top] = [0, 0];

	/** @param {string} label @param {Child[]} head @param {"menu" | "group"} role @param {Child[]} children */
	function show(label, head, role, ...children) {
		fill(menu, h("p.menu-head", ...head), h("div", { role, "aria-label": label }, ...children));
		if (!menu.matches(":popover-open")) menu.showPopover();
		const box = menu.getBoundingClientRect();
		menu.style.left = `${Math.max(4, Math.min(left, innerWidth - box.width - 4))}px`;
		menu.style.top = `${Math.max(4, Math.min(top, innerHeight - box.height - 4))}px`;
		all("button, input", menu)[0]?.focus();
	}
	const close = () => menu.matches(":popover-open") && menu.hidePopover();
	menu.addEventListener("toggle", (event) => {
		if (/** @type {ToggleEvent} */ (event).newState !== "open") takes = null;
	});

	/** @param {string} sign @param {Child[]} words @param {string} key @param {() => void} act */
	const item = (sign, words, key, act) =>
		h(
			"button",
			{ role: "menuitem", onclick: () => (close(), act()) },
			icon(sign),
			h("span", ...words),
			key && h("kbd", key),
		);

	/** @param {{track: number | null, step: number, click?: Spot}} what */
	function open({ track, step, click }) {
		if (track !== null) actions.select(track);
		if (click) store.set({ playing: 0 });
		const { told } = state.get();
		const undo = store.get().server?.edits.undo;
		const at = (/** @type {string} */ name) =>
			commandOf(name).keys.slice(0, 1).map(keyLabel).join();
		show(
			track === null
				? `Corrections at step ${step}`
				: `Corrections of track ${track} at step ${step}`,
			[
				track === null ? "nobody" : idTag(track),
				track !== null && told?.names[track],
				h("span.sub", `step ${step}`),
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
			undo && item("i-undo", [`Undo: ${undo}`], "", () => actions.undo(-1)),
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
						"span.sub.alone",
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
							h("span.sub", ` ${whereIs(other, step, own)}`),
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
		const field = h("input.field", {
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
		const view = frame.contentDocument?.defaultView;
		if (view)
			capture(
				view,
				"pointerdown",
				({ button, clientX, clientY }) => (pressed = button === 2 ? [clientX, clientY] : null),
			);
		if (view)
			capture(view, "pointerup", (event) => {
				if (event.button !== 2 || !pressed || !store.get().sequence) return;
				const [x, y] = [event.clientX - pressed[0], event.clientY - pressed[1]];
				if (Math.hypot(x, y) > STILL) return;
				const { selection } = store.get();
				if (selection === null)
					return actions.note("info", "Nobody is selected", "Click on somebody, then press again.");
				const edge = frame.getBoundingClientRect();
				[left, top] = [edge.left + event.clientX + 2, edge.top + event.clientY + 2];
				open({ track: selection, step: shown() });
			});
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

/** @param {Context} context @param {TimelineSeam} timeline */
export function mountCorrecting(context, timeline) {
	const { store, actions } = context;
	const check = checkOf(context);
	const { state } = check;
	const menu = mountMenu(context, timeline, { exchange, join, name });

	/** The alternative that was looked at last, and of which place. */
	let looked = { id: "", other: 0 };
	state.on(["other"], ({ chosen: doubt, other }) => {
		if (doubt && other) looked = { id: doubt.id, other };
	});

	/** The place that was looked at last; answered, it is no longer in the queue. @type {Doubt | null} */
	let seen = null;
	state.on(["chosen"], ({ chosen: doubt }) => (seen = doubt ?? seen));
	store.on(["sequence"], () => (seen = null));

	const shown = () => store.get().step;
	const chosen = () => (store.get().place === "check" ? state.get().chosen : null);

	/** A place, the chosen one if none is given, where the playhead is at it. */
	function here(doubt = chosen()) {
		if (!doubt) return null;
		const film = filmSteps(doubt.first, doubt.last, store.get());
		return shown() >= film[0] && shown() <= film[film.length - 1] ? doubt : null;
	}

	/** Who is meant: the selected one, else the first of the chosen place. */
	function who() {
		const id = store.get().selection ?? chosen()?.tracks[0] ?? null;
		if (id === null)
			actions.note(
				"info",
				"Which track?",
				"Click a lane, a box or a person in 3D; [ and ] walk through them.",
			);
		return id;
	}

	/** The alternative of the place here with a word; 0 where there is none. @param {RegExp} word */
	function alternative(word) {
		const doubt = here();
		const { selection } = store.get();
		if (!doubt || (selection !== null && !doubt.tracks.includes(selection))) return 0;
		return Math.max(
			0,
			doubt.alternatives.findIndex(({ words, as_it_is: same }) => !same && word.test(words)),
		);
	}

	/** @param {Wish} wish @param {string} words  of what was done */
	async function say(wish, words) {
		if (!(await check.say([wish])) || store.get().place === "check") return;
		await actions.noteEdit(words, "It holds after every change of parameters.");
	}

	/** @param {number} one @param {number} other */
	function exchange(one, other, step = shown()) {
		return say(
			{ kind: "exchanged", step, tracks: [one, other] },
			`Tracks ${one} and ${other} exchanged from step ${step} on`,
		);
	}

	/** @param {number} one @param {number} other */
	function join(one, other) {
		const { timeline: lanes } = store.get();
		const lives = [one, other].map((id) => lanes?.tracks.find((track) => track.id === id));
		const [a, b] = lives;
		// Of two that are there at once it is said from when on.
		const both = a && b && Math.max(a.first, b.first) <= Math.min(a.last, b.last);
		return say(
			{ kind: "same", tracks: [one, other], ...(both && { step: shown() }) },
			`Tracks ${one} and ${other} are one person`,
		);
	}

	/** @param {number} track @param {string} name */
	function name(track, name) {
		return say({ kind: "name", step: shown(), tracks: [track], name }, `Track ${track} is ${name}`);
	}

	/** An exchange whose ends somebody changed, else the answer of the queue. @param {number} which */
	function answer(which) {
		const { ends } = state.get();
		const doubt = chosen();
		if (!doubt) return;
		const [one, other] = doubt.tracks;
		if (!which || !ends || !isOfTwo(doubt)) return check.answer(which);
		return check.say([
			{
				kind: "exchanged",
				step: ends[0],
				tracks: [one, other],
				...(ends[1] !== null && { to: ends[1] + 1 }),
			},
		]);
	}

	/** @param {-1 | 1} direction */
	function turn(direction) {
		const { queue, chosen: now } = state.get();
		const doubts = queue?.doubts ?? [];
		location.hash = "#check";
		const index = doubts.findIndex(({ id }) => id === now?.id);
		if (doubts.length) check.choose(turned(doubts, index, direction));
	}

	/** What one track says of itself here. @param {"came" | "left" | "nobody" | "different"} kind @param {string} words */
	function alone(kind, words) {
		const track = who();
		if (track === null) return;
		const step = kind === "nobody" ? {} : { step: shown() };
		return say({ kind, tracks: [track], ...step }, `Track ${track} ${words}`);
	}

	/** @type {Record<Correcting, () => void | Promise<any>>} */
	const EDITS = {
		next: () => turn(1),
		previous: () => turn(-1),
		crossing() {
			const doubt = nextCrossing(state.get().queue?.doubts ?? [], store.get().step);
			if (doubt) check.choose(doubt);
			else actions.note("info", "No two people come close", "None that is in doubt, that is.");
		},
		other() {
			const doubt = chosen();
			if (!doubt) return;
			const last = looked.id === doubt.id ? looked.other : otherOf(doubt);
			check.show(state.get().other ? 0 : last);
		},
		alternative() {
			const doubt = chosen();
			if (!doubt) return;
			const { other } = state.get();
			const all = distinct(doubt, other).map(([, k]) => k);
			check.show(all[(all.indexOf(other) + 1) % all.length]);
		},
		confirm: () => answer(0),
		apply() {
			const doubt = chosen();
			if (doubt) return answer(state.get().other || proposed(doubt));
		},
		skip: () => check.skip(),
		exchange() {
			const doubt = here();
			const which = alternative(/^exchanged/) || (doubt && state.get().ends ? otherOf(doubt) : 0);
			if (which) return answer(which);
			const track = who();
			if (track === null) return;
			const other = doubt && isOfTwo(doubt) && doubt.tracks.find((id) => id !== track);
			if (other && doubt.tracks.includes(track)) return exchange(track, other);
			menu.others("exchange", track);
		},
		split() {
			const which = alternative(/^two people/);
			return which ? answer(which) : alone("different", `is two people, cut at step ${shown()}`);
		},
		join() {
			const doubt = here();
			const which = alternative(/goes on/);
			const best = doubt && (state.get().other || proposed(doubt));
			// Where the place proposes it; what is hardly likely there is nobody's word for it.
			if (which && doubt?.kind === "join") return answer(which);
			if (which && best && /goes on/.test(doubt.alternatives[best].words)) return answer(best);
			const track = who();
			if (track !== null) menu.others("join", track);
		},
		nobody() {
			const which = alternative(/^nobody/);
			return which ? answer(which) : alone("nobody", "was nobody");
		},
		here() {
			const { selection, playing } = store.get();
			if (playing) store.set({ playing: 0 });
			const track = resultOf(store.get())?.tracks.some(({ id }) => id === selection)
				? selection
				: null;
			location.hash = "#check";
			actions.showTab("place");
			state.set({ placing: { track, step: shown(), clicks: [] } });
		},
		came: () => alone("came", `came in at step ${shown()}`),
		left: () => alone("left", `left at step ${shown()}`),
		name() {
			const track = who();
			if (track !== null) menu.name(track);
		},
		checked() {
			const { range, loop, frames } = store.get();
			const doubt = chosen() ?? here(seen);
			const [first, last] = loop
				? [range[0] ?? 0, range[1] ?? frames - 1]
				: doubt
					? [doubt.first, doubt.last]
					: [shown(), shown()];
			return say({ kind: "checked", first, last }, `Steps ${first} to ${last} are checked`);
		},
		menu() {
			const track = who();
			if (track !== null) menu.open({ track, step: shown() });
		},
		truth: () => actions.saveFile("/api/corrections/truth.csv", "ground_truth.csv"),
	};
	actions.correct = (what) => EDITS[what]();
	mountMarks(context, timeline, check);
}
