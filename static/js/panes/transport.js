// @ts-check
/** Play, step, speed, loop and the readout. */
import { SPEEDS, parseStep, secondsOf } from "../clock.js";
import { commandOf } from "../commands.js";
import { chooser, fill, h, icon, tipOf, write } from "../dom.js";

const LEGEND = ["seen", "coasting", "miss", "birth", "death", "switch"];

/** @param {Context} context */
export function mountTransport({ store, actions, playback }) {
	/** @param {string} name @param {string} sign @param {string} [classes] */
	const button = (name, sign, classes = "") =>
		h(
			"button",
			{ class: `btn icon up ${classes}`, "aria-label": commandOf(name).title, ...tipOf(name), onclick: () => commandOf(name).run(actions) },
			icon(sign),
		);
	const play = button("play", "i-play", "play");
	const step = h("b", {}, "0");
	const of = h("span", {}, "/ 0");
	const time = h("b", { class: "time-of" }, "0.00");
	const read = h("button", { class: "read up", "data-tip": "Type a step, or seconds with an s", "aria-label": "Go to step" }, step, of, h("span", {}, "·"), time, h("span", {}, "s"));
	const typed = h("input", { "aria-label": "Step, or seconds with an s", hidden: true });
	const holder = h("div", { class: "read" }, read, typed);

	read.addEventListener("click", () => {
		typed.value = String(store.get().shown);
		typed.hidden = false;
		read.hidden = true;
		typed.focus();
		typed.select();
	});
	const close = () => {
		typed.hidden = true;
		read.hidden = false;
	};
	typed.addEventListener("blur", close);
	typed.addEventListener("keydown", (event) => {
		event.stopPropagation();
		if (event.key === "Escape") close();
		if (event.key !== "Enter") return;
		const sequence = store.get().server?.sequence;
		const wanted = sequence ? parseStep(typed.value, sequence.fps, sequence.frames) : null;
		if (wanted !== null) playback.seek(wanted);
		close();
	});

	const speed = chooser({ label: "Speed", choose: (value) => store.set({ speed: Number(value) }) });
	fill(speed.select, SPEEDS.map((value) => h("option", { value }, `${value}×`)));
	const loopText = h("span", { class: "v" });
	const loop = h("button", { class: "btn up", ...tipOf("loop", "Loop; I and O set its ends"), onclick: () => actions.toggleLoop() }, icon("i-loop"), loopText);

	const legend = h("div", { class: "legend", "aria-label": "Signs in the lanes" });
	for (const word of LEGEND) legend.append(h("span", {}, icon(`l-${word}`), word));

	const root = h(
		"div",
		{ class: "trans" },
		h(
			"div",
			{ class: "keys" },
			button("first", "i-start", "start"),
			button("previous-event", "i-evp", "start"),
			button("step-back", "i-prev", "start"),
			play,
			button("step-forward", "i-next"),
			button("next-event", "i-evn"),
			button("last", "i-end"),
		),
		holder,
		h("span", { class: "rule" }),
		speed.root,
		loop,
		h("span", { class: "grow" }),
		legend,
	);

	store.on(["shown", "server"], ({ shown, server }) => {
		const sequence = server?.sequence;
		write(step, String(shown < 0 ? 0 : shown));
		write(of, `/ ${sequence?.frames ?? 0}`);
		write(time, sequence ? secondsOf(Math.max(0, shown), sequence.fps) : "0.00");
		// Room for the largest number, so that nothing moves sideways.
		step.style.minWidth = `${String(sequence?.frames ?? 0).length}ch`;
		time.style.minWidth = `${secondsOf(sequence?.frames ?? 0, sequence?.fps ?? 25).length}ch`;
	});
	store.on(["playing"], ({ playing }) => {
		play.querySelector("use")?.setAttribute("href", playing ? "#i-pause" : "#i-play");
		play.setAttribute("aria-label", playing ? "Pause" : "Play");
	});
	const buttons = [...root.querySelectorAll("button"), speed.select];
	const marks = () => {
		const { loop: on, range: [from, to], server, speed: now } = store.get();
		const frames = server?.sequence?.frames ?? 1;
		for (const button of buttons) button.toggleAttribute("disabled", !server?.sequence);
		loop.setAttribute("aria-pressed", String(on));
		write(loopText, from === null && to === null ? "all" : `${from ?? 0} – ${to ?? frames - 1}`);
		speed.select.value = String(now);
	};
	store.on(["loop", "range", "server", "speed"], marks);
	marks();
	return root;
}
