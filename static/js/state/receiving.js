/** What the server tells, put into the store. */
import { fetcher, getJson } from "./api.js";
import { commandOf, perform } from "./commands.js";

/** Forgotten when another sequence is opened. */
const FORGOTTEN = /** @type {const} */ ({
	basis: "",
	revision: 0,
	timeline: null,
	span: null,
	scores: null,
	result: null,
	shown: -1,
	step: 0,
	moved: false,
	playing: 0,
	loop: false,
	hover: null,
	pointed: null,
	zooms: {},
	follow: false,
	listed: "all",
});

/**
 * @param {object} how
 * @param {Store<PageState>} how.store
 * @param {Context["playback"]} how.playback
 * @param {Actions} how.actions
 * @param {ReturnType<typeof import("./address.js").createAddress>} how.address
 * @param {(origin: string) => boolean} how.isOld  an own seek that a newer one has overtaken
 */
export function createReceiver({ store, playback, actions, address, isOld }) {
	/** A part was asked for, and not the whole. */
	let partial = false;
	/** Whether the server has figures of what is open. */
	let scored = false;

	/**
	 * @param {Server.State} told
	 * @param {boolean} [streamed]  it came over the socket, in order
	 */
	function receiveState(told, streamed = false) {
		// A method is a choice as a value is.
		const server = { ...told, parameters: { ...told.parameters, ...told.methods } };
		const before = store.get().server;
		const changed = before?.sequence?.key !== server.sequence?.key;
		// An answer to a request may be older than what the socket has brought since, and another
		// sequence comes with the socket's word on its playhead.
		if (!streamed && (!before || changed || server.version < before.version)) return;
		// The server was started anew: when the same sequence is open again, go where we were.
		if (before?.sequence && !server.sequence) address.returnTo(before);
		if (before === null) address.begin(server);
		if (changed) {
			scored = false;
			if (before?.sequence && server.sequence) tellWhoOpened(before.sequence, server.sequence);
			playback.clear(server.playhead);
			store.set({
				// What went wrong before it was opened is over.
				notes: store
					.get()
					.notes.filter(({ level }) => level !== "error" || !before || !server.sequence),
				...FORGOTTEN,
				range: [null, null],
				selection: server.selection,
			});
		} else if (before) {
			if (before.selection !== server.selection) store.set({ selection: server.selection });
			// Whoever looks through a camera in 3D wants to see its picture.
			if (before.view !== server.view && typeof server.view === "number")
				store.set({ large: server.view });
		}
		const { sequence } = server;
		const same = sequence && JSON.stringify(sequence) === JSON.stringify(before?.sequence);
		if (!same)
			store.set({
				sequence,
				frames: sequence?.frames ?? 0,
				fps: sequence?.fps ?? 25,
				cameras: sequence?.cameras ?? [],
			});
		// Another's news may come before the answer to what was just switched here.
		const layers3d = { ...server.layers, ...store.get().wished3d };
		store.set({ server, run: server.run, layers3d });
		// The first word on the theme after a start of the server is this browser's, later ones are
		// everybody's.
		if (before?.session === server.session) store.set({ theme: server.theme });
		else if (server.theme !== store.get().theme)
			void actions.ask("POST", "theme", { theme: store.get().theme });
		if (changed || address.waitsFor(server)) address.arrive(server);
		if (changed || before?.pinned?.key !== server.pinned?.key) void fetchScores();
		if (before === null || before.opening?.name !== server.opening?.name) void fetchSequences();
	}

	/**
	 * All windows show the same recording: who did not open the new one is told, with the way back.
	 * @param {Server.SequenceInfo} before
	 * @param {Server.SequenceInfo} now
	 */
	function tellWhoOpened(before, now) {
		const { asked } = store.get();
		store.set({ asked: "" });
		if (asked && [now.name, now.opened_as].includes(asked)) return;
		actions.note(
			"warn",
			`${now.name} was opened in another window`,
			"All windows of one workbench show the same recording.",
			{ word: `Back to ${before.name}`, act: () => void actions.open(before.opened_as) },
		);
	}

	/** The server shows this run, and its people as they are by now. @param {{run: string, revision: number}} news */
	function showRun({ run, revision }) {
		const { basis, revision: before } = store.get();
		if (run === basis && revision === before) return;
		store.set({ basis: run, revision });
		void fetchTimeline();
	}

	/** What is asked for of a long recording: what is shown and as much again at either side. */
	function part() {
		const { span, timeline } = store.get();
		partial = Boolean(span && (partial || (timeline?.stride ?? 1) > 1));
		const [first, last] = (partial && span) || [0, 1e9];
		const beside = last - first;
		return `first=${Math.max(0, Math.floor(first - beside))}&last=${Math.ceil(last + beside)}`;
	}

	/** While a run goes on, lanes that are there grow once a second. */
	const rest = () => {
		const { run, timeline, basis } = store.get();
		return timeline?.run === basis && run?.state === "computing" ? 1000 : 150;
	};

	const fetchTimeline = fetcher(async () => {
		if (!store.get().sequence) return;
		const timeline = await getJson(`/api/timeline?${part()}`);
		// Lanes of another run would mix the two; its own news is on the way.
		if (timeline.run === store.get().basis) store.set({ timeline });
	}, rest);

	const fetchScores = fetcher(async () => {
		const { sequence } = store.get();
		if (!sequence || !scored) return;
		const scores = await getJson(`/api/evaluation/curves?${part()}`);
		if (store.get().sequence?.key === sequence.key) store.set({ scores });
	});

	const fetchSequences = fetcher(async () =>
		store.set({ sequences: (await getJson("/api/sequences")).sequences }),
	);
	const fetchSchema = fetcher(async () => store.set({ schema: await getJson("/api/schema") }));

	store.on(["span"], ({ timeline }) => {
		if (!partial && (timeline?.stride ?? 1) <= 1) return;
		void fetchTimeline();
		void fetchScores();
	});

	/** What to do with each kind of message. @type {Record<string, (message: any) => void>} */
	const KINDS = {
		state: ({ state }) => receiveState(state, true),
		progress({ run }) {
			if (run.key === store.get().server?.run.key) store.set({ run });
		},
		playhead({ step, origin }) {
			if (store.get().sequence && !isOld(origin)) playback.follow(step);
		},
		step(message) {
			showRun(message);
			playback.receive(message);
		},
		timeline(news) {
			showRun(news);
			void fetchTimeline();
		},
		evaluation() {
			scored = true;
			void fetchScores();
		},
		tasks: ({ tasks }) => store.set({ tasks }),
		study({ study }) {
			const before = store.get().study;
			store.set({ study });
			if (study.state !== "done" || before?.name !== study.name || before?.state === "done") return;
			if (store.get().place !== "study")
				actions.note("info", `The study ${study.name} is done`, "", {
					word: "Show",
					act: () => (location.hash = "#study"),
				});
		},
		notice: ({ level, message, hint, report }) =>
			actions.note(
				level,
				message,
				hint ?? "",
				report && { word: "Copy the report", act: () => navigator.clipboard.writeText(report) },
			),
		command({ name }) {
			// Of a 3D view in a window of its own: keys of our frame come by themselves.
			if (document.hasFocus() && document.activeElement instanceof HTMLIFrameElement) return;
			perform(commandOf(name), actions);
		},
	};

	return {
		receiveState,
		/** A message of the socket. @param {any} message */
		receive: (message) => KINDS[message.type]?.(message),
		/** The socket is open: fetch what it does not bring. */
		refresh() {
			if (!store.get().schema) void fetchSchema();
			// The server's first word has it asked for.
			if (store.get().server) void fetchSequences();
			void fetchTimeline();
		},
	};
}
