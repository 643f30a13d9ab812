/** Runs leave: a menu of forms, then each is written by the server and saved by the browser. */
import { fill, h, icon } from "../elements/dom.js";
import { chooser } from "../elements/drawn.js";
import { menuOf, opensMenu } from "../elements/over.js";
import { getJson } from "../state/api.js";

const exportButton = () =>
	h("button.btn.box", { "aria-haspopup": "menu" }, icon("i-export"), "Export", icon("i-down", "s"));

/** A browser begins to read a file before the next one takes its place, milliseconds. */
const SAVES_MS = 250;

/**
 * @param {object} how
 * @param {Store<PageState>} how.store
 * @param {Actions} how.actions
 * @param {() => (number | null)[]} how.chosen  runs of the library; null is the one that is shown
 * @param {(words: string, cancel?: () => void) => void} how.say
 * @param {HTMLElement} [how.button]  that opens it, where there is one
 */
export function exportMenu({ store, actions, chosen, say, button = exportButton() }) {
	const forms = h("div", { role: "menu", "aria-label": "Export as" });
	const menu = menuOf({}, forms);
	opensMenu(button, menu, () => void list());
	const [first, last] = ["first step", "last step"].map((words) =>
		h("input", { type: "number", min: 0, placeholder: words, "aria-label": `Video, ${words}` }),
	);
	const speeds = [1, 0.5, 0.25, 0.1].map((value) => [
		value,
		value === 1 ? "real speed" : `${value}×`,
	]);
	const speed = chooser("Video, speed", speeds, 1, () => {});
	const part = h("div.video-part", h("b", "Of a video"), h("span", first, " – ", last, " ", speed));
	let listed = false;

	/** Once the server has told them; asked again when the menu is opened again. */
	async function list() {
		if (listed) return;
		const told = await getJson("/api/exports/formats").catch((error) => error);
		if (told instanceof Error) {
			fill(menu, h("p.small", `What can be written is not known: ${told.message}`));
			return;
		}
		listed = true;
		fill(menu, forms, part);
		fill(
			forms,
			told.formats.map((/** @type {Server.FormatInfo} */ form) =>
				h(
					"button",
					{ role: "menuitem", onclick: () => (menu.hidePopover(), void write(form)) },
					h("b", form.word),
					h("span.small", form.help),
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

	/**
	 * An export, once it is over or another one has taken its place.
	 * @param {string} number
	 * @param {(now: Server.Task) => void} tell  how far it is
	 * @returns {Promise<Server.Task>}
	 */
	const ended = (number, tell) =>
		new Promise((resolve) => {
			const unsubscribe = store.on(["tasks"], look);
			function look() {
				const now = store.get().tasks.export;
				// The server was started again, or has not told of it yet.
				if (!now || Number(now.of) < Number(number)) return;
				if (now.of === number && now.state === "writing") return tell(now);
				unsubscribe();
				resolve(now.of === number ? now : { ...now, state: "cancelled" });
			}
			look();
		});

	/** @param {Server.FormatInfo} form */
	async function write(form) {
		for (const run of chosen()) {
			const called = run === null ? "This run" : `Run ${run}`;
			let now = await actions.ask("POST", "exports", {
				format: form.name,
				run,
				...(form.video ? wanted() : {}),
			});
			if (!now) return;
			now = await ended(String(now.number), ({ done, total }) =>
				say(
					`${called} as ${form.word}${total ? ` ${Math.round((100 * done) / total)} %` : ""}`,
					() => void actions.ask("DELETE", "exports"),
				),
			);
			say("");
			if (now.state === "failed")
				return actions.note("error", `${called} was not written as ${form.word}`, now.error);
			if (now.state !== "done") return;
			const link = h("a", { href: "/api/exports/file", download: now.words });
			link.click();
			await new Promise((resolve) => setTimeout(resolve, SAVES_MS));
			say(`${now.words} was saved`);
		}
	}
	return [button, menu];
}
