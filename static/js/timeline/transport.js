/** Play, step, speed, loop and the readout. */
import { SPEEDS, parseStep, secondsOf } from "../play/clock.js";
import { all, choices, parts, write } from "../elements/dom.js";

/** @type {Pane} */
export function mountTransport(root, { store, playback }) {
	const { play, read, step, of, seconds, typed, speed, loop, range, real, turn, hindsight } =
		parts(root);
	const close = () => {
		typed.hidden = true;
		read.hidden = false;
	};
	read.addEventListener("click", () => {
		typed.value = String(store.get().shown);
		typed.hidden = false;
		read.hidden = true;
		typed.select();
	});
	typed.addEventListener("blur", close);
	typed.addEventListener("keydown", (event) => {
		event.stopPropagation();
		const { fps, frames } = store.get();
		const wanted = event.key === "Enter" ? parseStep(typed.value, fps, frames) : null;
		if (wanted !== null) playback.seek(wanted);
		if (event.key === "Enter" || event.key === "Escape") close();
	});
	choices(
		speed,
		SPEEDS.map((value) => [value, `${value}×`]),
		1,
	);
	speed.addEventListener("change", () => {
		store.set({ speed: Number(speed.value) });
		speed.blur();
	});

	store.on(["shown", "sequence"], ({ shown, frames, fps }) => {
		write(step, String(Math.max(0, shown)));
		write(of, `/ ${Math.max(0, frames - 1)}`);
		write(seconds, secondsOf(Math.max(0, shown), fps));
		// Room for the largest number, so that nothing moves sideways.
		step.style.minWidth = `${String(frames).length}ch`;
		seconds.style.minWidth = `${secondsOf(frames, fps).length}ch`;
	});
	store.on(["playing"], ({ playing }) => {
		play.querySelector("use")?.setAttribute("href", playing ? "#i-pause" : "#i-play");
		play.ariaLabel = playing ? "Pause" : "Play";
	});
	const marks = () => {
		const {
			loop: on,
			range: [from, to],
			frames,
			speed: now,
		} = store.get();
		for (const control of all("button:not([data-command=maximise-time]), select", root))
			control.disabled = !frames;
		loop.ariaPressed = String(on);
		write(range, from === null && to === null ? "all" : `${from ?? 0} – ${to ?? frames - 1}`);
		speed.value = String(now);
	};
	store.watch(["loop", "range", "sequence", "speed"], marks);
	store.watch(["server", "link"], ({ server, link }) => {
		const method = server?.parameters.smoothing_method;
		hindsight.disabled = !method || link !== "open";
		write(hindsight, `smoothing ${method === "none" ? "off" : "on"}`);
		hindsight.ariaPressed = String(method !== "none");
	});
	store.watch(["realTime", "turn"], ({ realTime, turn: how }) => {
		write(real, realTime ? "real time" : "every step");
		write(turn, { page: "turns pages", centre: "centred", off: "stays" }[how]);
	});
}
