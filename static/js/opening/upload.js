/** Files that a person drops or chooses, and the way of their bytes to the server. */
import { request } from "../state/api.js";

/** Bytes of a piece: as much as the server takes at once. */
const PIECE = 1 << 20;

/** Files that are announced at once, so that their names fit into what the server takes. */
export const ANNOUNCED = 2000;

/** Files on their way at once. */
const AT_ONCE = 3;

/** Files of the system and of editors, which nobody means. @param {string} path */
const meant = (path) => !path.split("/").some((part) => part.startsWith("."));

/** What was dropped, folders with all in them. @param {any[]} entries @returns {Promise<Dropped[]>} */
export async function dropped(entries) {
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
export const chosen = (files) =>
	[...files]
		.map((file) => ({ path: file.webkitRelativePath || file.name, file }))
		.filter(({ path }) => meant(path));

/** What the server is told of them. @param {Dropped[]} files */
export const announced = (files) => ({
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
export async function send(key, numbers, files, signal, tell) {
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
