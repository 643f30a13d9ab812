/** A recording whose folder is gone: its runs stay readable, and somebody may say where it is now. */
import { h, write } from "../elements/dom.js";

/**
 * @param {object} how
 * @param {Actions} how.actions
 * @param {(recording: Server.RecordingInfo) => void} how.moved
 */
export function lostRecording({ actions, moved }) {
	/** @type {Server.RecordingInfo | null} */
	let now = null;
	const why = h("span", {});
	const place = h("input", {
		class: "field",
		placeholder: "folder where it lies now",
		"aria-label": "Folder where the recording lies now",
		onkeydown: (/** @type {KeyboardEvent} */ event) => event.key === "Enter" && void find(),
	});
	const element = h(
		"div",
		{ class: "lost", role: "status", hidden: true },
		why,
		place,
		h("button", { class: "btn box", onclick: () => void find() }, "Find…"),
	);

	async function find() {
		if (!now || now.id === null) return;
		if (!place.value.trim()) return place.focus();
		const told = await actions.ask("POST", `library/recordings/${now.id}/place`, {
			place: place.value.trim(),
		});
		if (!told) return;
		place.value = "";
		moved(told);
	}

	return {
		element,
		/** @param {Server.RecordingInfo | null} recording */
		show(recording) {
			now = recording;
			element.hidden = !recording?.missing || recording.id === null;
			write(why, `${recording?.missing ?? ""}. Its runs stay readable.`);
		},
	};
}
