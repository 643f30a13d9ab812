/** A file of the server's, saved by the browser. */
import { ApiError, request } from "../state/api.js";

/** @param {Actions} actions @param {string} path @param {string} name */
export async function sendsFile(actions, path, name) {
	try {
		const blob = await (await request(path)).blob();
		const link = document.createElement("a");
		link.href = URL.createObjectURL(blob);
		link.download = name;
		link.click();
		setTimeout(() => URL.revokeObjectURL(link.href), 10_000);
	} catch (error) {
		if (!(error instanceof ApiError)) throw error;
		actions.note("error", error.message, error.hint ?? "");
	}
}
