/** The bar under the runs: what can be done with those that are ticked, and what was just done. */
import { fill, h, icon, one, choices } from "../elements/dom.js";
import { request, getJson } from "../state/api.js";
import { many, size } from "./words.js";

/* ---------- Runs leave: a menu of forms, then each is written by the server and saved by the
   browser. */

const ASKS_MS = 250;

/**
 * @param {object} how
 * @param {Actions} how.actions
 * @param {() => number[]} how.chosen
 * @param {(words: string, cancel?: () => void) => void} how.say
 */
function exportMenu({ actions, chosen, say }) {
	const forms = h("div", { role: "menu", "aria-label": "Export as" });
	const menu = h("div", { class: "menu", popover: "auto" }, forms);
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
		void list();
	});
	menu.addEventListener("keydown", (event) => {
		const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
		if (!step || part.contains(/** @type {Node} */ (event.target))) return;
		const all = [...menu.querySelectorAll("button")];
		const at = all.indexOf(/** @type {HTMLButtonElement} */ (document.activeElement));
		all[(at + step + all.length) % all.length].focus();
		event.preventDefault();
		event.stopPropagation();
	});
	const [first, last] = ["first step", "last step"].map((words) =>
		h("input", { type: "number", min: 0, placeholder: words, "aria-label": `Video, ${words}` }),
	);
	const speed = h("select", { "aria-label": "Video, speed" });
	choices(
		/** @type {any} */ (speed),
		[1, 0.5, 0.25, 0.1].map((value) => [value, value === 1 ? "real speed" : `${value}×`]),
		1,
	);
	const part = h(
		"div",
		{ class: "video-part" },
		h("b", {}, "Of a video"),
		h("span", {}, first, " – ", last, " ", speed),
	);
	let listed = false;

	/** Once the server has told them; asked again when the menu is opened again. */
	async function list() {
		if (listed) return;
		const told = await getJson("/api/exports/formats").catch((error) => error);
		if (told instanceof Error) {
			fill(menu, h("p", { class: "small" }, `What can be written is not known: ${told.message}`));
			return;
		}
		listed = true;
		fill(menu, forms, part);
		fill(
			forms,
			told.formats.map((/** @type {Server.FormatInfo} */ form) =>
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
		);
		menu.querySelector("button")?.focus();
	}

	/** Which part of a video, and how fast. */
	const wanted = () => ({
		first: first.valueAsNumber || 0,
		last: Number.isFinite(last.valueAsNumber) ? last.valueAsNumber : null,
		speed: Number(speed.value),
	});

	/** @param {Server.FormatInfo} form */
	async function write(form) {
		for (const run of chosen()) {
			let now = await actions.ask("POST", "exports", {
				format: form.name,
				run,
				...(form.video ? wanted() : {}),
			});
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

/**
 * @param {object} how
 * @param {Actions} how.actions
 * @param {() => number[]} how.chosen
 * @param {() => void} how.none  choose none
 * @param {() => Promise<void>} how.refresh  runs are others now
 */
export function chosenBar({ actions, chosen, none, refresh }) {
	/** @type {Server.Deleted | null} */
	let deleted = null;
	const picked = h("b");
	const line = h("span", { role: "status", class: "gone-line" });
	const stop = h("button", { class: "btn" }, "Stop");
	const undo = h(
		"button",
		{ class: "btn", "data-key": "Ctrl Z", onclick: () => void takeBack() },
		"Undo",
	);
	const side = h(
		"button",
		{ class: "btn box", onclick: () => void compare() },
		icon("i-swap"),
		"Compare",
	);
	/** @param {string} words @param {() => void} [cancel] */
	const say = (words, cancel) => {
		fill(line, words);
		undo.hidden = true;
		stop.hidden = !cancel;
		stop.onclick = cancel ?? null;
		element.hidden = !words && !chosen().length;
	};
	const tools = h(
		"span",
		{ class: "picked", role: "toolbar", "aria-label": "Chosen runs" },
		picked,
		side,
		exportMenu({ actions, say, chosen }),
		h(
			"button",
			{ class: "btn box", onclick: () => void remove(chosen()) },
			icon("i-trash"),
			"Delete",
		),
		h(
			"button",
			{ class: "btn icon", "aria-label": "Choose none", onclick: none },
			icon("i-close", "s"),
		),
	);
	const element = h(
		"div",
		{ class: "undo-line" },
		tools,
		h("span", { class: "grow" }),
		line,
		stop,
		undo,
	);

	async function compare() {
		const dialog = /** @type {any} */ (one(".compare"));
		const numbers = chosen().map((id) => `runs=${id}`);
		const answer = await request(`/api/library/compared?${numbers.join("&")}`).catch(
			(error) => error,
		);
		if (answer instanceof Error)
			return actions.note("error", "The runs cannot be compared", answer.message);
		dialog.innerHTML = await answer.text();
		dialog.onclick = () => dialog.close();
		dialog.showModal();
	}

	/** @param {number[]} ids */
	async function remove(ids) {
		if (!ids.length) return;
		deleted = await actions.ask("POST", "library/delete", { runs: ids });
		none();
		await refresh();
	}

	async function takeBack() {
		if (!deleted) return;
		if (await actions.ask("POST", "library/take-back", { runs: deleted.runs })) deleted = null;
		await refresh();
	}

	return {
		element,
		remove,
		takeBack,
		/** What was deleted is over: others are chosen. */
		forget: () => (deleted = null),
		show() {
			const count = chosen().length;
			fill(picked, `${count} chosen`);
			tools.hidden = !count;
			side.disabled = count < 2 || count > 4;
			side.title = side.disabled ? "Two to four runs stand side by side" : "";
			undo.hidden = !deleted;
			stop.hidden = true;
			if (deleted) {
				const { runs, bytes } = deleted;
				const what = runs.length === 1 ? `Run ${runs[0]}` : many(runs.length, "run");
				fill(line, icon("i-trash", "s"), `${what} deleted, ${size(bytes)}`);
			}
			element.hidden = !count && !deleted;
		},
	};
}
