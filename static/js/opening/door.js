/** Where recordings come in: a key, a button, a drop. The sheet is read when wanted. */
import { one } from "../elements/dom.js";

/** @param {Context} context */
export function mountDoor(context) {
	const layer = one(".drop-layer");
	const dialog = /** @type {any} */ (one("dialog.opener"));
	/** @type {Promise<any> | undefined} */
	let sheet;
	const read = () =>
		(sheet ??= import("./sheet.js").then(({ mountOpening }) => mountOpening(context)));
	context.actions.openSheet = () => void read().then(({ toggle }) => toggle());

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
	frame.addEventListener("load", () => frame.contentWindow?.addEventListener("dragenter", cover));
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
