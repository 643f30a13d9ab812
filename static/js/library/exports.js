/** Runs leave: a menu of forms, then each is written by the server and saved by the browser. */
import { fill, h, icon } from "../elements/dom.js";
import { getJson } from "../state/api.js";

const ASKS_MS = 250;

/**
 * @param {object} how
 * @param {Actions} how.actions
 * @param {() => number[]} how.chosen
 * @param {(words: string, cancel?: () => void) => void} how.say
 */
export function exportMenu({ actions, chosen, say }) {
	const menu = h("div", {
		class: "menu",
		role: "menu",
		popover: "auto",
		"aria-label": "Export as",
	});
	const button = h(
		"button",
		{ class: "btn box", "aria-haspopup": "menu" },
		icon("i-export"),
		"Export",
		icon("i-down", "s"),
	);
	button.popoverTargetElement = menu;
	menu.addEventListener("toggle", (event) => {
		if (/** @type {ToggleEvent} */ (event).newState !== "open") return;
		const { left, top } = button.getBoundingClientRect();
		Object.assign(menu.style, { left: `${left}px`, bottom: `${innerHeight - top + 6}px` });
		menu.querySelector("button")?.focus();
	});
	menu.addEventListener("keydown", (event) => {
		const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
		if (!step) return;
		const all = [...menu.querySelectorAll("button")];
		const at = all.indexOf(/** @type {HTMLButtonElement} */ (document.activeElement));
		all[(at + step + all.length) % all.length].focus();
		event.preventDefault();
		event.stopPropagation();
	});
	void getJson("/api/exports/formats").then(({ formats }) =>
		fill(
			menu,
			formats.map((/** @type {Server.FormatInfo} */ form) =>
				h(
					"button",
					{
						role: "menuitem",
						onclick: () => (menu.hidePopover(), void write(form)),
					},
					h("b", {}, form.word),
					h("span", { class: "small" }, form.help),
				),
			),
		),
	);

	/** @param {Server.FormatInfo} form */
	async function write(form) {
		for (const run of chosen()) {
			let now = await actions.ask("POST", "exports", { format: form.name, run });
			if (!now) return;
			const { number } = now;
			while (now.state === "writing" && now.number === number) {
				const share = now.total ? ` ${Math.round((100 * now.done) / now.total)} %` : "";
				say(`Run ${run} as ${form.word}${share}`, () => void actions.ask("DELETE", "exports"));
				await new Promise((resolve) => setTimeout(resolve, ASKS_MS));
				now = await getJson("/api/exports").catch((error) => ({
					state: "failed",
					error: error.message,
				}));
			}
			say("");
			if (now.state === "failed")
				return actions.note("error", `Run ${run} was not written as ${form.word}`, now.error);
			if (now.state !== "done") return;
			const link = h("a", { href: "/api/exports/file", download: now.name });
			link.click();
			await new Promise((resolve) => setTimeout(resolve, ASKS_MS));
			say(`${now.name} was saved`);
		}
	}
	return [button, menu];
}
