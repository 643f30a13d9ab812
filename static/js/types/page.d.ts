/**
 * What the page keeps, known in every module; no browser loads it. What the server sends is in
 * `server.d.ts`.
 * Steps are 0-based; boxes are `[left, top, width, height]` in pixels; positions are metres.
 */

type Timer = ReturnType<typeof setTimeout> | undefined;
type Brush = CanvasRenderingContext2D;
type Box = [number, number, number, number];

/** Of an element. */
type Child = Node | string | number | null | undefined | false;

/** An element of the markup by its `data-ref`: it has what its tag has. */
type Part = HTMLElement &
	Omit<HTMLInputElement & HTMLSelectElement & HTMLIFrameElement, keyof HTMLElement>;

/** Of `h`: listeners by `on…`, style properties by `--…`, and plain attributes. */
interface Attributes {
	onclick?: (event: MouseEvent) => void;
	ondblclick?: (event: MouseEvent) => void;
	onkeydown?: (event: KeyboardEvent) => void;
	onpointermove?: (event: PointerEvent) => void;
	[name: string]: unknown;
}

/** What makes elements of a kind, by tag and classes. */
interface Maker<Kinds> {
	<T extends string>(
		tag: T,
		attributes: Attributes,
		...children: (Child | Child[])[]
	): Kinds[TagOf<T> & keyof Kinds];
	<T extends string>(tag: T, ...children: (Child | Child[])[]): Kinds[TagOf<T> & keyof Kinds];
}

/** What hears of events on their way to what they happen in. */
interface Capture {
	<K extends keyof HTMLElementEventMap>(
		target: EventTarget,
		kind: K,
		act: (event: HTMLElementEventMap[K]) => void,
	): void;
	(target: EventTarget, kind: string, act: (event: Event) => void): void;
}

/** `button` of `button.btn.box`. */
type TagOf<T extends string> = T extends `${infer Tag}.${string}` ? Tag : T;

/** How many times, and the middle of what is seen, in shares of the picture. */
type Magnified = [number, number, number];

/** A magnification in its cell: how many times, and what lies beyond left and top, CSS pixels. */
type Lens = { k: number; left: number; top: number };

type Bookmark = { step: number; note: string };

/** A line of the palette. */
type Offer = {
	title: string;
	/** In the title, and set as in formulas where it is read. */
	symbol?: string;
	keys: string[];
	run: () => void;
};

type ApiFailure = { code: string; detail: string; hint?: string | null };

/** Each value stands for `stride` steps, the first from step `first` on. */
type Buckets = { first: number; stride: number };

/** Of each bucket. */
type Summary = { low: number[]; high: number[]; mean: number[] };

/** What a note offers to do about it. */
type Remedy = {
	word: string;
	act: () => void;
	/** The edit that it takes back, in the server's words: offered while that is the last one. */
	edit?: string;
};

type Note = {
	id: number;
	level: "info" | "warn" | "error";
	title: string;
	text: string;
	remedy?: Remedy;
	/** What was refused: gone once the like is accepted. */
	about?: string;
	/** How often it was said. */
	times: number;
};

interface PageState {
	link: "connecting" | "open" | "lost";
	/** Milliseconds since 1970. */
	lostAt: number;
	/** Milliseconds since 1970. */
	retryAt: number;
	server: Server.State | null;
	/** The newest progress, also between two states. */
	run: Server.RunInfo | null;
	/** The study that had news last. */
	study: Server.StudyInfo | null;
	schema: Server.Schema | null;
	/** That is open, and of it:. */
	sequence: Server.SequenceInfo | null;
	frames: number;
	fps: number;
	cameras: Server.CameraInfo[];
	sequences: Server.SequenceEntryInfo[];
	/**
	 * Key of the run that the server shows: that in `run`, or while that has no step yet, one before.
	 */
	basis: string;
	/** Of its people: they are others where this is another. */
	revision: number;
	/** Always of the run `basis`. */
	timeline: Server.Timeline | null;
	/** Steps that the timeline shows of a long recording; null: all of them. */
	span: [number, number] | null;
	/** What is asked for. */
	step: number;
	/** What is painted. */
	shown: number;
	/** Of the painted step. */
	result: Server.Step | null;
	/** Counts up whenever a picture arrives or leaves. */
	loaded: number;
	playing: 0 | 1 | -1;
	speed: number;
	loop: boolean;
	/** In and out points. */
	range: [number | null, number | null];
	selection: number | null;
	hover: { id: number; camera: number } | null;
	/** The detection under the pointer. */
	pointed: { camera: number; box: number } | null;
	/** Pictures that are looked at closer, by camera. */
	zooms: Record<number, Magnified>;
	/** Whether a glass goes with the pointer over the pictures. */
	loupe: boolean;
	/** Whether pictures keep the selected track in the middle. */
	follow: boolean;
	layers2d: Record<string, boolean>;
	layers3d: Record<string, boolean>;
	/** Layers in 3D that were switched here and that the server has not confirmed. */
	wished3d: Record<string, boolean>;
	/** Whether steps are left out where painting is slower than the clock. */
	realTime: boolean;
	/** Whether the nearest picture stands for one that is missing. */
	nearest: boolean;
	/** What the timeline does while the playhead moves through a part of it. */
	turn: "page" | "centre" | "off";
	/** Which tracks are listed. */
	listed: "all" | "false" | "missed" | "worst";
	/** Steps that somebody has marked in this recording. */
	bookmarks: Bookmark[];
	/** The camera that is shown large; null: all alike. */
	large: number | null;
	tab: (typeof import("../state/address.js").TABS)[number];
	/** Words of the parameters that are listed; all where empty. */
	sought: string;
	/** The events that are listed and gone to; all where empty. */
	eventKind: "" | LaneEvent["kind"];
	/** Whether all figures are compared, or the headlines. */
	every: boolean;
	/** Of the run that was set against the truth last. */
	scores: Server.Scores | null;
	/** Of the run whose identities were checked without truth last. */
	identity: Server.IdentityInfo | null;
	/** Work of the server in the background, by its kind. */
	tasks: Record<string, Server.Task>;
	/** Layouts of somebody's own, by name. */
	layouts: Record<string, PageState["layout"]>;
	/** What is plotted of the selected track, by the server's names. */
	plots: string[];
	/** What the timeline plots. */
	measure: "ospa" | "gospa";
	laneOrder: "longest" | "born";
	/** Names of commands that were chosen in the palette, the last one first. */
	used: string[];
	/** Shares of the window, and the pane that is alone. */
	layout: { right?: number; cams?: number; lanes?: number; max?: PaneName };
	theme: "dark" | "light";
	singleKeys: boolean;
	notes: Note[];
	/** What this page asked the server to open. */
	asked: string;
	/** Which of the page's places is looked at. */
	place: string;
	/** Whether a new study was asked for, of what is open. */
	wantsStudy: boolean;
	/** What people were called by hand, by track. */
	names: Record<number, string>;
	/** What stands beside the words of the places, by name. */
	signs: Record<string, string>;
	/** Whether somebody has chosen a step of this sequence. */
	moved: boolean;
	/** Notices that were closed for good, by name. */
	dismissed: string[];
}

/** Metres over the steps; null where there is no pair. */
type Course = { first: number; values: (number | null)[] };

/** A file that somebody dropped or chose; its path from the dropped folder. */
type Dropped = { path: string; file: File };

type PaneName = "view" | "cams" | "side" | "time";

interface Command {
	name: string;
	title: string;
	group: "Play" | "Cameras and 3D" | "Teach" | "Tracks" | "Parameters" | "Check" | "Page";
	keys: string[];
	/** A name of `Actions`. */
	action: string;
	/** Its argument. */
	value?: any;
}

/** What a person can do. */
interface Actions {
	note: (
		level: "info" | "warn" | "error",
		title: string,
		text: string,
		remedy?: Remedy,
		/** Of what was refused: its command, or the first part of its path. */
		about?: string,
	) => void;
	/** Says what was just edited, with a button that takes it back. */
	noteEdit: (title: string, text: string) => Promise<void>;
	/** Says what the server told of it; throws what is no answer of the server. */
	refused: (error: unknown, about: string) => void;
	/** What was refused before is no longer said. */
	accepted: (about: string) => void;
	ask: (method: "POST" | "PATCH" | "DELETE", path: string, body?: object) => Promise<any>;
	/** Its answer, or true where it has none; null after a failure, which is told. */
	command: (name: string, fields?: object) => Promise<any>;
	togglePlay: () => void;
	shuttle: (direction: -1 | 0 | 1) => void;
	stepBy: (steps: number) => void;
	secondsBy: (seconds: number) => void;
	changeSpeed: (direction: -1 | 1) => void;
	toggleLoop: () => void;
	markRange: (end: 0 | 1) => void;
	toEvent: (direction: -1 | 1) => void;
	select: (id: number | null) => void;
	/** This track alone, again: all. */
	solo: (id: number) => void;
	nextTrack: (direction: -1 | 1) => void;
	/** To an event: its step and track. */
	go: (place: string) => void;
	clear: () => void;
	exportTracks: () => void;
	/** Open the menu of the forms that the shown run leaves in. */
	exportForms: () => void;
	/** Save what an address gives, once it is known that it gives it; a name where the answer has none. */
	saveFile: (path: string, fallback: string) => Promise<void>;
	/** As the large picture. */
	chooseCamera: (index: number) => void;
	/** In 3D; null is the free view. */
	lookThrough: (view: number | "top" | null) => void;
	freeView: () => void;
	/** In the pictures and in 3D. */
	toggleLayer: (layer: string) => void;
	toggleLayer2d: (layer: string) => void;
	toggleLayer3d: (layer: string) => void;
	open: (name: string) => Promise<any>;
	/** A run of the library, as it was, and its recording. */
	openRun: (number: number, recording: string) => Promise<any>;
	openSheet: () => void;
	change: (changes: Record<string, any>) => Promise<any>;
	reset: (...keys: string[]) => void;
	preset: (name: string) => void;
	savePreset: (name: string) => Promise<any>;
	renamePreset: (name: string, to: string) => Promise<any>;
	removePreset: (name: string) => Promise<any>;
	cancel: () => void;
	/** The parameters of a run before, by its number. */
	useAgain: (number: string) => void;
	runAgain: () => void;
	/** Pin the shown run, and compute one of another single-view method beside it. */
	compareWith: (method: string) => Promise<void>;
	pin: (on: boolean) => void;
	/** Smoothing on or off. */
	hindsight: () => void;
	/** Of the shown run, without truth. */
	checkIdentities: (what: "start" | "stop") => void;
	/** The shown run and the pinned one change places. */
	swap: () => Promise<void>;
	/** The last edit of anything, or what was undone last. */
	undo: (direction: -1 | 1) => void;
	copyRun: (what: "command" | "json") => void;
	/** Begin to drag boxes on pictures, or leave it. */
	drawTemplate: () => void;
	/** Handles in 3D, on or off. */
	editRoom: () => void;
	saveTaught: () => void;
	showTab: (tab: PageState["tab"]) => void;
	showTour: () => void;
	/** To the other one; to the system's, which nobody chose, where one is given. */
	toggleTheme: (wished?: PageState["theme"]) => void;
	/** Null: all panes as they were at first. */
	maximise: (pane: PaneName | null) => void;
	help: () => void;
	palette: () => void;
	/** Something that is on or off. */
	/** How long trails are, seconds, and whether they fade. */
	trail: (changes: { seconds?: number; fades?: boolean }) => void;
	fadeTrails: () => void;
	toggle: (what: "realTime" | "follow" | "loupe" | "nearest") => void;
	/** A pane and a kind of file: `cams png`. */
	keepPicture: (what: string) => Promise<void>;
	nextTurn: () => void;
	/** Something of the selected track over time, there or away; the menu where nothing is named. */
	plot: (name?: string) => void;
	wholePictures: () => void;
	/** By the name of a layout, ours or one's own. */
	arrange: (name: string) => void;
	/** This layout under a name that is asked for. */
	keepLayout: () => void;
	/** Mark the shown step, or go to its note. */
	bookmark: () => void;
	/** Put something right, or go to what may be wrong. */
	correct: (what: Correcting) => void | Promise<void>;
	/** Of the timeline; above 1 shows more steps. */
	zoom: (factor: number) => void;
}

/** What is painted at once. */
interface Frame {
	step: number;
	/** By camera; undefined where it is not loaded and will not be. */
	pictures: (Picture | undefined)[];
	/** By camera: what is laid over its picture. */
	maps: Picture[][];
	result: Server.Step | null;
	/** The result is of the run before, shown faintly until the new one is there. */
	stale: boolean;
}

/** What every pane is given. */
interface Context {
	store: Store<PageState>;
	playback: ReturnType<typeof import("../play/playback.js").createPlayback>;
	actions: Actions;
	/** Connect now. */
	retry: () => void;
	/** Run the command of a key; whether there was one. */
	press: (event: KeyboardEvent) => boolean;
}

/** What others draw in the timeline, and ask of it. */
interface TimelineSeam {
	plot: HTMLElement;
	draw: () => void;
	/** Rows of others, under its own: each draws one. */
	rows: ((pen: Pen) => void)[];
	/** What is under the pointer. */
	at: (event: PointerEvent) => { step: number; track: Server.TrackLife | undefined };
	/** Draws doubtful places under the ruler, and what was put right over the lanes. */
	marks?: (check: Pen, lanes: Pen, how: { tracks: Server.TrackLife[]; scroll: number }) => void;
	/** Draws the braid of identities; read when the page is there. */
	braid?: (
		pen: Pen,
		scores: NonNullable<PageState["scores"]>,
		tracks: Server.TrackLife[],
		selection: number | null,
	) => void;
}

/** One of the places of the top bar. */
interface PageSite {
	name: string;
	word: string;
	tip: string;
	/** It is the workbench with its clock: all commands mean there what they mean in Tune. */
	bench?: boolean;
	/** Reads what fills it, when it is first gone to. */
	read?: () => Promise<Pane>;
	/** Whether what it shows exists; always where it is left out. */
	exists?: (state: Readonly<PageState>) => boolean;
	/** A sign beside its word: a count, a dot. */
	sign?: (state: Readonly<PageState>) => string;
}

/** Fills its part of the page and keeps it current. */
type Pane = (root: HTMLElement, context: Context) => void;

/** Of the timeline, CSS pixels. */
type Row = { y: number; height: number };

/** What a row is drawn with. */
type Pen = { g: Brush; row: Row; view: View; ink: Palette };

interface Lanes {
	/** In the order of the lanes. */
	tracks: Server.TrackLife[];
	pinned: (Server.TrackLife & { like: number | null })[];
	/** Pixels. */
	scroll: number;
	laneHeight: number;
	done: number;
	selection: number | null;
	hover: number | null;
	switches: Server.Switch[];
	decisions: Server.Decided[];
}

/** The steps an axis of `width` CSS pixels shows. */
type View = { first: number; last: number; width: number };

type LaneEvent = {
	step: number;
	id: number;
	kind: Server.Timeline["events"][0][2] | "switch" | "doubt";
};

/** Of the mosaic of pictures. */
type Cell = { x: number; y: number; width: number; height: number };

/** Values: what differs from the defaults. */
type Place = {
	sequence: string | null;
	step: number | null;
	selection: number | null;
	camera: number | null;
	/** Through which camera, or from where, the 3D view looks. */
	look: number | "top" | null;
	values: Record<string, any> | null;
	/** Of the pinned run. */
	pinned: Record<string, any> | null;
	/** Words of the address. */
	view: Record<string, string>;
};

type Picture = {
	bitmap: ImageBitmap | null;
	missing: string | null;
	/** Step that it is of. */
	of?: number;
};

interface Palette {
	/** A token without its dashes. */
	get: (name: string) => string;
	id: (id: number) => string;
	/** Ink on the colour of an id. */
	on: (id: number) => string;
	font: string;
}

interface Scene {
	/** CSS pixels a picture pixel. */
	scale: number;
	/** CSS pixels. */
	width: number;
	/** CSS pixels. */
	height: number;
	layers: Record<string, boolean>;
	selection: number | null;
	hover: number | null;
	/** The detection that is pointed at. */
	pointed: number | null;
	/** Only the selected track. */
	alone: boolean;
	/** What people were called by hand, by track. */
	names: Record<number, string>;
	people: Server.Step["truth"];
	/** Whether trails are fainter the older they are. */
	fades: boolean;
	opacity: number;
	ink: Palette;
}

interface Store<T extends object> {
	get: () => Readonly<T>;
	set: (patch: Partial<T>) => void;
	on: (keys: (keyof T)[], listener: (state: Readonly<T>) => void) => () => void;
	/** The same, and told at once. */
	watch: (keys: (keyof T)[], listener: (state: Readonly<T>) => void) => () => void;
}

/** Of a table. */
interface Column<R> {
	word: string;
	/** What stands in its head, where that is not its word. */
	head?: Child;
	/** Classes. */
	kind?: string;
	help?: string;
	cell: (row: R) => string | number | Child | Child[];
	/** Makes it sortable: by a number, or by what the cells say. */
	by?: ((row: R) => number) | boolean;
	/** Changes with the shown step. */
	live?: boolean;
}

interface TableHow<R> {
	key: (row: R) => string | number;
	/** Word of the column that sorts at first; without one rows stay in their order. */
	by?: string;
	/** From the largest. */
	down?: boolean;
	/** By click or Enter. */
	choose?: (row: R, event: MouseEvent | KeyboardEvent) => void;
	/** By double click. */
	open?: (row: R) => void;
	/** Of the row, and its listeners. */
	attributes?: (row: R) => Record<string, any>;
}

/** A table. */
interface Table<R> {
	element: HTMLTableElement;
	show: (rows: R[]) => void;
	/** Fill the columns that change with the step. */
	live: () => void;
	each: (act: (row: R, element: HTMLTableRowElement) => void) => void;
}

/** Things that belong to a step. */
interface Kept<V> {
	want: (names: string[]) => void;
	get: (name: string) => V | undefined;
	put: (name: string, value: V) => void;
	forget: (name: string) => void;
	clear: () => void;
	names: () => IterableIterator<string>;
}

interface CacheHow<V> {
	load: (name: string, signal: AbortSignal) => Promise<V>;
	sizeOf: (value: V) => number;
	/** In the unit of `sizeOf`. */
	budget: number;
	/** Requests at a time. */
	parallel?: number;
	arrived: (name: string) => void;
	dispose?: (value: V) => void;
	/** A value stands for the failure and is kept; without one the name may be wanted again. */
	failed: (name: string, error: unknown) => V | undefined;
}
