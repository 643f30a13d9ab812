/** The sheet that opens recordings: by a key, by a drop anywhere, from files or from the disk. */
import { all, h, one } from "../elements/dom.js";
import { redraw } from "../elements/drawn.js";
import { isBench } from "../state/address.js";
import { ApiError, fetcher, getJson, request, sendJson } from "../state/api.js";
import { draftSheet } from "./draft.js";
import { startHead, startSheet } from "./start.js";

/* ---------- Files that a person drops or chooses, and the way of their bytes to the server. */

/** Bytes of a piece: as much as the server takes at once. */
const PIECE = 1 << 20;

/** Files that are announced at once, so that their names fit into what the server takes. */
const ANNOUNCED = 2000;

/** Files on their way at once. */
const AT_ONCE = 3;

/** Files of the system and of editors, which nobody means. @param {string} path */
const meant = (path) => !path.split("/").some((part) => part.startsWith("."));

/** What was dropped, folders with all in them. @param {any[]} entries @returns {Promise<Dropped[]>} */
async function dropped(entries) {
	/** @type {Dropped[]} */
	const found = [];
	/** @param {any} entry @param {string} above */
	async function walk(entry, above) {
		const path = above + entry.name;
		if (!meant(path)) return;
		if (entry.isFile) {
			const file = await new Promise((good, bad) => entry.file(good, bad));
			found.push({ path, file });
			return;
		}
		const reader = entry.createReader();
		// A reader gives some at a time, and none at the end.
		for (;;) {
			const some = await new Promise((good, bad) => reader.readEntries(good, bad));
			if (!some.length) return;
			for (const one of some) await walk(one, `${path}/`);
		}
	}
	for (const entry of entries) if (entry) await walk(entry, "");
	return found;
}

/** What was chosen in a dialog. @param {FileList} files @returns {Dropped[]} */
const chosen = (files) =>
	[...files]
		.map((file) => ({ path: file.webkitRelativePath || file.name, file }))
		.filter(({ path }) => meant(path));

/** What the server is told of them. @param {Dropped[]} files */
const announced = (files) => ({
	files: files.map(({ path, file }) => ({ path, bytes: file.size })),
});

/**
 * Send files piece by piece.
 * @param {string} key  of the import
 * @param {number[]} numbers  of them, as the server counts
 * @param {Dropped[]} files
 * @param {AbortSignal} signal
 * @param {(bytes: number) => void} tell  how many more are there
 */
async function send(key, numbers, files, signal, tell) {
	let next = 0;
	async function work() {
		while (next < files.length) {
			const number = next;
			next += 1;
			const { file } = files[number];
			for (let offset = 0; offset < file.size; offset += PIECE) {
				const body = file.slice(offset, offset + PIECE);
				const path = `/api/import/${key}/files/${numbers[number]}?offset=${offset}`;
				await request(path, { method: "PUT", body, signal });
				tell(body.size);
			}
		}
	}
	await Promise.all(Array.from({ length: AT_ONCE }, work));
}

/** @param {Context} context */
export function mountOpening({ store, actions }) {
	const dialog = /** @type {any} */ (one("dialog.opener"));
	dialog.tabIndex = -1;
	/** @type {Server.ImportInfo | null} */
	let info = null;
	/** Wishes to go back to, newest last.  @type {Server.ImportWish[]} */
	let past = [];
	/** @type {AbortController | null} */
	let sending = null;
	/** What was dropped and is on its way: all is looked into when the last of it is here. */
	let under = 0;
	let [trouble, turns] = ["", 0];
	/** Whether what is written is opened as well. */
	let opens = false;
	/** What is being wished, one after the other; looking and writing come after it. */
	let wishing = Promise.resolve();

	/** Do something with the server; what it refuses is told in the sheet. @param {() => Promise<any>} work */
	async function attempt(work) {
		trouble = "";
		try {
			await work();
		} catch (error) {
			if (error instanceof DOMException && error.name === "AbortError") return;
			if (!(error instanceof ApiError)) throw error;
			if (error.code === "no_import") info = null;
			trouble = [error.message, error.hint].filter(Boolean).join(" ");
		}
		if (!info) await start();
		else say(trouble);
	}

	/** @param {string} words  in place of what the foot says */
	function say(words) {
		for (const place of words ? all(".say", dialog) : []) place.title = place.textContent = words;
	}

	async function start() {
		const known = await getJson("/api/recordings");
		if (info) return;
		draw([...startSheet(known), trouble && h("p.s-foot.say", { role: "alert" }, trouble)]);
		seek();
	}

	/** Only the recordings whose words hold what is sought are shown. */
	function seek() {
		const { value } = one("#open-find", dialog);
		for (const card of all(".rec", dialog))
			card.hidden = !card.textContent?.toLowerCase().includes(value.toLowerCase());
	}

	/** @param {Server.ImportInfo} next */
	function take(next) {
		if (info?.key === next.key && next.version < info.version) return;
		info = next;
		if (next.phase === "written") {
			info = null;
			past = [];
			dialog.close();
			actions.note("info", `${next.wish.name} was imported`, next.folder);
			if (opens) toBench();
		} else {
			draw(draftSheet(next, store.get().schema?.methods ?? {}, (room) => wish({ room })));
			// It may have been told of before this answer came.
			void read();
		}
	}

	/** Read what is known by now, if it is more than what is shown. */
	const read = fetcher(async () => {
		await wishing;
		const news = info && store.get().tasks[`import ${info.key}`];
		if (info && news && news.done > info.version) await look(info.key);
	});
	/** @param {string} key */
	const look = (key) =>
		attempt(async () => {
			const asked = turns;
			const now = await getJson(`/api/import/${key}`);
			// What was wished meanwhile is not in this answer.
			if (asked === turns && info?.key === key) take(now);
		});
	store.on(["tasks"], read);
	// A server that was started again knows it no more.
	store.on(["link"], ({ link }) => link === "open" && info && void look(info.key));

	/** @param {Child[]} sheet */
	function draw(sheet) {
		const held = document.activeElement;
		// Whoever types or drags is not disturbed: what he does is sent when he has done it.
		const wide = dialog.classList.contains("wide");
		const types =
			held instanceof HTMLInputElement &&
			held.id !== "open-find" &&
			held.value !== held.defaultValue;
		if ((dialog.contains(held) && types) || one("[data-held]", dialog)) return;
		// Another sheet begins at itself: its buttons are no others' successors.
		if (dialog.classList.toggle("wide", Boolean(info)) !== wide && dialog.open) dialog.focus();
		redraw(dialog, sheet);
	}

	/** @param {Partial<Server.ImportWish>} changes @param {boolean} [undone] */
	function wish(changes, undone) {
		if (!info) return;
		if (!undone) past.push(info.wish);
		// Of another camera meanwhile more may be wished than a control was drawn with.
		const [{ names, offsets }, before] = [changes, info.wish];
		const told = undone
			? { ...before, ...changes }
			: {
					...before,
					...changes,
					names: { ...before.names, ...names },
					offsets: { ...before.offsets, ...offsets },
				};
		info = { ...info, wish: told };
		const { key } = info;
		const turn = (turns += 1);
		// Each tells all that is wished: one that came late would take the next one back.
		const tell = () =>
			attempt(async () => {
				const answer = await sendJson("PUT", `/api/import/${key}/wish`, told);
				if (turn === turns && info?.key === key) take(answer);
			});
		wishing = wishing.then(tell, tell);
	}

	/** What a control wishes, with its value where that belongs. @param {Part} control */
	function wishOf({ dataset, value, tagName }) {
		const number = Number(value) * Number(dataset.scale ?? 1);
		const fits = (/** @type {string} */ _, /** @type {any} */ part) =>
			part === "$"
				? value || (tagName === "SELECT" ? null : "")
				: part === "#"
					? value
						? number
						: null
					: part;
		return JSON.parse(dataset.wish ?? "{}", fits);
	}

	/** @param {Dropped[]} files */
	function bring(files) {
		if (!files.length) return;
		if (!dialog.open) dialog.showModal();
		void attempt(async () => {
			const more = info;
			if (!more) await giveUp();
			let path = more ? `/api/import/${more.key}/files` : "/api/import";
			/** @type {number[]} */
			const numbers = [];
			async function announce() {
				const some = files.slice(numbers.length, numbers.length + ANNOUNCED);
				const { draft, first } = await sendJson("POST", path, announced(some));
				path = `/api/import/${draft.key}/files`;
				numbers.push(...some.map((_, k) => first + k));
				take(draft);
				return draft;
			}
			const own = (sending ??= new AbortController());
			under += 1;
			/** @type {Server.ImportInfo} */
			let draft;
			try {
				draft = await announce();
				while (numbers.length < files.length) draft = await announce();
				const begun = performance.now();
				let sent = 0;
				await send(draft.key, numbers, files, own.signal, (bytes) => {
					sent += bytes;
					const speed = sent / 1e3 / (performance.now() - begun + 1);
					const part = (draft.received + sent) / draft.bytes;
					for (const bar of all(".bar", dialog)) {
						bar.style.setProperty("--part", String(part));
						bar.ariaValueNow = String(Math.round(100 * part));
					}
					const [here, whole] = [draft.received + sent, draft.bytes].map((b) =>
						(b / 1e6).toFixed(1),
					);
					say(`${here} of ${whole} MB · ${speed.toFixed(0)} MB/s`);
				});
			} catch (error) {
				// What cannot be finished leaves nothing behind.
				if (numbers.length && sending === own) await giveUp();
				throw error;
			} finally {
				under -= 1;
			}
			if (!under) take(await sendJson("POST", `/api/import/${draft.key}/arrived`));
		});
	}

	async function giveUp() {
		sending?.abort();
		sending = null;
		past = [];
		const gone = info;
		info = null;
		if (gone) await request(`/api/import/${gone.key}`, { method: "DELETE" });
	}

	/** @param {boolean} open */
	const write = (open) =>
		attempt(async () => {
			await wishing;
			if (!info || one("[data-do=track]", dialog).disabled) return;
			opens = open;
			if (open) store.set({ asked: info.wish.name });
			take(await sendJson("POST", `/api/import/${info.key}/write`, { open }));
		});

	/** @param {boolean} folder */
	function choose(folder) {
		const input = h("input", { type: "file", multiple: true, webkitdirectory: folder });
		input.onchange = () => input.files && bring(chosen(input.files));
		input.click();
	}

	/** Who opens a recording wants to see it, wherever he was. */
	function toBench() {
		if (!isBench(store.get().place)) location.hash = "#tune";
	}

	/** @param {string} name */
	function recording(name) {
		dialog.close();
		toBench();
		void actions.open(name);
	}

	/** What the sheet's buttons do. @type {Record<string, (value: string) => void>} */
	const DO = {
		close: () => dialog.close(),
		files: () => choose(false),
		folder: () => choose(true),
		library() {
			dialog.close();
			location.hash = "#library";
		},
		recording,
		path: () =>
			void attempt(async () => {
				const { draft, recording: folder } = await sendJson("POST", "/api/import/path", {
					path: one("#open-path", dialog).value,
				});
				if (draft) take(draft);
				else recording(folder);
			}),
		"give-up": () => void attempt(giveUp),
		import: () => void write(false),
		track: () => void write(true),
	};

	dialog.addEventListener("click", (/** @type {any} */ { target }) => {
		if (target === dialog) return dialog.close();
		const button = target.closest("button");
		if (button?.dataset.wish) wish(wishOf(button));
		else DO[button?.dataset.do]?.(button.dataset.value);
	});
	dialog.addEventListener("submit", (/** @type {Event} */ event) => event.preventDefault());
	dialog.addEventListener(
		"change",
		(/** @type {any} */ { target }) => target.dataset.wish && wish(wishOf(target)),
	);
	dialog.addEventListener("input", (/** @type {any} */ { target }) => {
		if (target.id === "open-find") seek();
	});
	dialog.addEventListener("keydown", (/** @type {any} */ event) => {
		const { target, key } = event;
		const types = target.matches("input");
		if (key === "Enter" && target.id === "open-find") {
			if (target.value) one(".rec:not([hidden])", dialog)?.click();
		} else if (key === "Enter" && types) {
			// The field is left, for what is typed in is not written over.
			const open = target.form?.querySelector("button");
			target.blur();
			open && (open.focus(), open.click());
		}
		if (!event.ctrlKey && !event.metaKey) return key === "Enter" && types && event.preventDefault();
		if (key === "Enter") void write(true);
		else if (key === "o") dialog.close();
		else if (key === "z" && !types && past.length) wish(past.pop() ?? {}, true);
		else return;
		event.preventDefault();
	});
	dialog.addEventListener("close", () => {
		// What was sought would take the next Escape for itself.
		if (!info) dialog.replaceChildren();
	});
	return {
		toggle() {
			if (dialog.open) return dialog.close();
			dialog.showModal();
			if (info) return take(info);
			// At once, also where the server is busy.
			draw(startHead());
			void attempt(start);
		},
		/** What was dropped. @param {any[]} entries */
		take: (entries) =>
			dropped(entries).then(bring, ({ message }) =>
				actions.note("error", "What was dropped cannot be read", message),
			),
	};
}
