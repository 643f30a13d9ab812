/** What lies over the page: menus, and the one tip. */
import { all, capture, fill, h } from "./dom.js";

/* ---------- Menus: a popover whose lines are walked by arrows, and whose keys are its own. */

/** @param {Attributes} attributes @param {...(Child | Child[])} lines */
export function menuOf(attributes, ...lines) {
	const menu = h("div.menu", { popover: "auto", ...attributes }, ...lines);
	menu.addEventListener("keydown", (event) => {
		const turn = { ArrowDown: 1, ArrowUp: -1 }[event.key];
		const stops = all("button, [type=checkbox]", menu);
		const at = stops.indexOf(/** @type {any} */ (document.activeElement));
		if (turn && at >= 0) {
			stops[(at + turn + stops.length) % stops.length].focus();
			event.preventDefault();
		}
		if (event.key !== "Escape") event.stopPropagation();
	});
	return menu;
}

/**
 * Have a button open a menu beside it, towards the middle of the window, whose edges would cut it.
 * @param {HTMLElement} button @param {HTMLElement} menu @param {() => void} [opened]
 */
export function opensMenu(button, menu, opened) {
	Object.assign(button, { popoverTargetElement: menu });
	menu.addEventListener("toggle", (event) => {
		if (/** @type {ToggleEvent} */ (event).newState !== "open") return;
		const { left, right, top, bottom } = button.getBoundingClientRect();
		const [far, low] = [left > innerWidth / 2, top > innerHeight / 2];
		Object.assign(menu.style, {
			left: far ? "auto" : `${left}px`,
			right: far ? `${innerWidth - right}px` : "auto",
			top: low ? "auto" : `${bottom + 6}px`,
			bottom: low ? `${innerHeight - top + 6}px` : "auto",
		});
		all("button, input", menu)[0]?.focus();
		opened?.();
	});
}

/* ---------- The tip: what a control does, its key, and why it cannot be pressed. */

/** A pointer rests on a control for so long before its tip comes, milliseconds. */
const AFTER = 350;
/** CSS pixels from a control to its tip, and from there to the edges of the window. */
const [AWAY, RIM] = [6, 4];

export function mountTips() {
	const tip = h("div.tip", { popover: "manual", role: "tooltip" });
	document.body.append(tip);
	/** Whose tip is there, or will be. @type {HTMLElement | null} */
	let over = null;
	/** Who came by Tab asks what a control is; who gets the focus back from a dialog does not. */
	let tabbed = false;
	/** @type {Timer} */
	let waiting;

	function hide() {
		clearTimeout(waiting);
		over = null;
		if (tip.matches(":popover-open")) tip.hidePopover();
	}
	/** @param {HTMLElement} control */
	function show(control) {
		if (!control.checkVisibility()) return hide();
		const { tip: words = "", key = "" } = control.dataset;
		fill(tip, [words, key && h("span.key", key), control.ariaDescription]);
		tip.showPopover();
		const at = control.getBoundingClientRect();
		const { width, height } = tip.getBoundingClientRect();
		const left = at.left + (at.width - width) / 2;
		const below = at.bottom + AWAY;
		tip.style.left = `${Math.max(RIM, Math.min(innerWidth - width - RIM, left))}px`;
		tip.style.top = `${below + height + RIM > innerHeight ? at.top - AWAY - height : below}px`;
	}
	/** @param {EventTarget | null} target @param {number} after */
	function ask(target, after) {
		const control = /** @type {HTMLElement | null} */ (
			target instanceof Element ? target.closest("[data-tip]") : null
		);
		if (control === over) return;
		hide();
		// Who is there needs no word on where it leads.
		if (!control || control.ariaCurrent === "page") return;
		over = control;
		waiting = setTimeout(show, after, control);
	}
	document.addEventListener(
		"pointerover",
		({ target, pointerType }) => pointerType !== "touch" && ask(target, AFTER),
	);
	document.addEventListener("focusin", ({ target }) => tabbed && ask(target, 0));
	document.addEventListener("focusout", hide);
	document.documentElement.addEventListener("pointerleave", hide);
	for (const kind of ["pointerdown", "wheel"]) capture(document, kind, hide);
	capture(document, "keydown", ({ key }) => {
		tabbed = key === "Tab";
		hide();
	});
}
