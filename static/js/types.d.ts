/**
 * What comes over the wire and what the page keeps, known in every module; no browser loads it.
 * Steps are 0-based; boxes are `[left, top, width, height]` in pixels; positions are metres.
 */

type Timer = ReturnType<typeof setTimeout> | undefined;
type Brush = CanvasRenderingContext2D;
type Box = [number, number, number, number];

/** Of an element. */
type Child = Node | string | number | null | undefined | false;

/** An element of the markup by its `data-ref`: it has what its tag has. */
type Part = HTMLElement & Omit<HTMLInputElement & HTMLSelectElement & HTMLIFrameElement, keyof HTMLElement>;

/** Of `h`: listeners by `on…`, style properties by `--…`, and plain attributes. */
interface Attributes {
	onclick?: (event: MouseEvent) => void;
	ondblclick?: (event: MouseEvent) => void;
	onkeydown?: (event: KeyboardEvent) => void;
	onpointermove?: (event: PointerEvent) => void;
	[name: string]: unknown;
}

type ApiFailure = {code: string, message: string, field: string | null, hint: string | null};

interface CameraInfo {
	name: string;
	width: number;
	height: number;
	has_pictures: boolean;
	has_detections: boolean;
}

interface SequenceInfo {
	/** Changes with the content, so that pictures may be cached for ever. */
	key: string;
	name: string;
	description: string;
	fps: number;
	frames: number;
	has_pictures: boolean;
	has_detections: boolean;
	has_truth: boolean;
	cameras: CameraInfo[];
	templates: number;
}

interface RunState {
	key: string;
	state: "idle" | "computing" | "done" | "failed" | "cancelled";
	/** Steps that are computed. */
	done: number;
	total: number;
	steps_per_second: number | null;
	seconds_left: number | null;
	/** The stage that takes the time. */
	message: string;
	error: string | null;
}

interface ServerState {
	version: number;
	sequence: SequenceInfo | null;
	opening: {name: string, message: string, done: number, total: number} | null;
	/** In the page with the methods among them. */
	parameters: Record<string, any>;
	changed: string[];
	/** The command that computes the same in a terminal. */
	command: string;
	methods: {single_view: string, fusion_method: string, smoothing_method: string};
	/** Those that somebody has saved. */
	presets: string[];
	/** The one whose values the parameters have. */
	preset: string | null;
	playhead: number;
	selection: number | null;
	run: RunState;
	pinned: {key: string, changed: string[]} | null;
	teaching: {key: string, unsaved: number, editing_room: boolean};
	viser: {path: string};
	/** Of the 3D view. */
	layers: Record<string, boolean>;
	/** What the 3D view looks through. */
	view: number | "top" | null;
	theme: "dark" | "light";
}

interface TrackInView {
	id: number;
	box: Box | null;
	seen: boolean;
	detection_probability: number | null;
	/** Index of the box that fed it, -1 where none did. */
	source: number;
	fed_by: {box: Box, weight: number, share: number} | null;
	hidden_by: number | null;
	visible: boolean;
	reason: string | null;
	centre: [number, number] | null;
	/** Steps from now, x and y of the feet. */
	trail: [number, number, number][];
}

/** Labels of the camera's own estimates. */
type ViewEvent = {kind: string, labels: number[]};

interface CameraStep {
	name: string;
	measurements: {box: Box, score: number}[];
	estimates: {box: Box, weight: number, label: number}[];
	samples?: [number, number, number][] | null;
	events: ViewEvent[];
	/** Of the method, by name. */
	information: Record<string, number>;
	/** The query of its address, null where there is none. */
	foreground: string | null;
	/** The same of the map of likelihoods. */
	likelihood: string | null;
	/** Centre x and y; xx, xy, yy of the ellipse's matrix. */
	gates: [number, number, number, number, number][];
	tracks: TrackInView[];
	truth: {id: number, box: Box | null, valid: boolean}[];
}

interface StepResult {
	run: string;
	step: number;
	computed: boolean;
	cameras: CameraStep[];
	tracks: {id: number, position: number[], sigma: number[], existence: number, seen: boolean[]}[];
	truth: {id: number, position: number[], valid: boolean, track: number | null, error: number | null}[];
	components: number;
	cardinality: number;
}

/** From and to are inclusive. */
type Span = [number, number, "seen" | "coasting" | "long miss"];

/** Seen: share of its life. */
type TrackLane = {id: number, first: number, last: number, seen: number, cameras: number[], spans: Span[]};

/** Each value stands for `stride` steps, the first from step `first` on. */
type Buckets = {first: number, stride: number};

/** Of each bucket. */
type Summary = {low: number[], high: number[], mean: number[]};

interface Timeline {
	run: string;
	done: number;
	frames: number;
	first: number;
	stride: number;
	cardinality: Summary;
	count: Summary;
	truth: Summary | null;
	tracks: TrackLane[];
	/** Like: the shown run's track. */
	pinned: {run: string, count: Summary, tracks: (TrackLane & {like: number | null})[]} | null;
	/** Step and track. */
	events: [number, number, "birth" | "death" | "long miss"][];
	left_out: number;
}

interface Parameter {
	key: string;
	group: string;
	name: string;
	label: string;
	help: string;
	symbol: string;
	unit: string;
	kind: string;
	default: any;
}

interface Schema {
	groups: {name: string, help: string}[];
	parameters: Parameter[];
	methods: Record<string, string[]>;
	presets: Record<string, Record<string, any>>;
}

interface SequenceEntry {
	name: string;
	description: string;
	kind: "rendered" | "folder";
	cameras: number | null;
	frames: number | null;
	ready: boolean;
	error?: string | null;
}

type Note = {id: number, level: "info" | "warn" | "error", title: string, text: string};

interface PageState {
	link: "connecting" | "open" | "lost";
	/** Milliseconds since 1970. */
	lostAt: number;
	/** Milliseconds since 1970. */
	retryAt: number;
	server: ServerState | null;
	/** The newest progress, also between two states. */
	run: RunState | null;
	schema: Schema | null;
	/** That is open, and of it:. */
	sequence: SequenceInfo | null;
	frames: number;
	fps: number;
	cameras: CameraInfo[];
	sequences: SequenceEntry[];
	/** Key of the run that the server shows: that in `run`, or while that has no step yet, one before. */
	basis: string;
	/** Always of the run `basis`. */
	timeline: Timeline | null;
	/** Steps that the timeline shows of a long recording; null: all of them. */
	span: [number, number] | null;
	/** What is asked for. */
	step: number;
	/** What is painted. */
	shown: number;
	/** Of the painted step. */
	result: StepResult | null;
	/** Counts up whenever a picture arrives or leaves. */
	loaded: number;
	playing: 0 | 1 | -1;
	speed: number;
	loop: boolean;
	/** In and out points. */
	range: [number | null, number | null];
	selection: number | null;
	hover: {id: number, camera: number} | null;
	layers2d: Record<string, boolean>;
	layers3d: Record<string, boolean>;
	/** The camera that is shown large; null: all alike. */
	large: number | null;
	tab: "tracks" | "step" | "events" | "teach" | "changes" | "compare" | "runs";
	/** The events that are listed and gone to; all where empty. */
	eventKind: "" | LaneEvent["kind"];
	/** Whether all figures are compared, or the headlines. */
	every: boolean;
	/** Of the run that was set against the truth last. */
	scores: Scores | null;
	/** What the timeline plots. */
	measure: "ospa" | "gospa";
	laneOrder: "longest" | "born";
	/** Shares of the window, and the pane that is alone. */
	layout: {right?: number, cams?: number, lanes?: number, max?: PaneName};
	theme: "dark" | "light";
	singleKeys: boolean;
	notes: Note[];
}

type ScoredTrack = {id: number, kind: string, person: number | null, mean_error: number | null, switches: number};

type Evaluation = {run: string, steps: number, partial: boolean, per_track: ScoredTrack[]};

/** Metres over the steps; null where there is no pair. */
type Course = {first: number, values: (number | null)[]};

/** Of a person's identity, from one track to another. */
type Switch = {step: number, before: number, track: number};

interface ScoreSeries {
	run: string;
	first: number;
	stride: number;
	unit: string;
	/** Cut-off and order, in words. */
	cost: string;
	gate: string;
	ospa: number[];
	ospa_localisation: number[];
	ospa_cardinality: number[];
	gospa: number[];
	gospa_localisation: number[];
	gospa_missed: number[];
	gospa_false: number[];
	/** How much of it is location, 0 … 1. */
	ospa_share: number[];
	gospa_share: number[];
	track_errors: (Course & {track: number})[];
	mean_error: (number | null)[];
	/** Upper ends for plots. */
	axes: {ospa: number, gospa: number, error: number};
	switches: Switch[];
}

type Scores = {evaluation: Evaluation, series: ScoreSeries, reference: ScoreSeries | null};

type PaneName = "view" | "cams" | "side" | "time";

interface Command {
	name: string;
	title: string;
	group: "Play" | "Cameras and 3D" | "Teach" | "Tracks" | "Parameters" | "Page";
	keys: string[];
	/** A name of `Actions`. */
	action: string;
	/** Its argument. */
	value?: any;
}

/** What a person can do. */
interface Actions {
	note: (level: "info" | "warn" | "error", title: string, text: string) => void;
	/** Null after a failure, which is told. */
	ask: (method: "POST" | "PATCH" | "DELETE", path: string, body?: object) => Promise<any>;
	togglePlay: () => void;
	shuttle: (direction: -1 | 0 | 1) => void;
	stepBy: (steps: number) => void;
	secondsBy: (seconds: number) => void;
	changeSpeed: (direction: -1 | 1) => void;
	toggleLoop: () => void;
	markRange: (end: 0 | 1) => void;
	toEvent: (direction: -1 | 1) => void;
	select: (id: number | null) => void;
	nextTrack: (direction: -1 | 1) => void;
	/** To an event: its step and track. */
	go: (place: string) => void;
	clear: () => void;
	exportTracks: () => void;
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
	pin: (on: boolean) => void;
	/** What the parameters were, whoever changed them. */
	remember: (before: Record<string, any>, after: Record<string, any>) => void;
	/** What can be undone. */
	forget: () => void;
	/** Or redo. */
	undo: (direction: -1 | 1) => void;
	copyRun: (what: "command" | "json") => void;
	/** Begin to drag boxes on pictures, or leave it. */
	drawTemplate: () => void;
	/** Handles in 3D, on or off. */
	editRoom: () => void;
	saveTaught: () => void;
	showTab: (tab: PageState["tab"]) => void;
	toggleTheme: () => void;
	/** Null: all panes as they were at first. */
	maximise: (pane: PaneName | null) => void;
	help: () => void;
	palette: () => void;
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
	result: StepResult | null;
	/** The result is of the run before, shown faintly until the new one is there. */
	stale: boolean;
}

/** What every pane is given. */
interface Context {
	store: Store<PageState>;
	playback: ReturnType<typeof import("./playback.js").createPlayback>;
	actions: Actions;
	/** Connect now. */
	retry: () => void;
	/** Run the command of a key; whether there was one. */
	press: (event: KeyboardEvent) => boolean;
}

/** Fills its part of the page and keeps it current. */
type Pane = (root: HTMLElement, context: Context) => void;

/** Of the timeline, CSS pixels. */
type Row = {y: number, height: number};

/** What a row is drawn with. */
type Pen = {g: Brush, row: Row, view: View, ink: Palette};

interface Lanes {
	/** In the order of the lanes. */
	tracks: TrackLane[];
	pinned: (TrackLane & {like: number | null})[];
	/** Pixels. */
	scroll: number;
	laneHeight: number;
	done: number;
	selection: number | null;
	hover: number | null;
	switches: Switch[];
}

/** The steps an axis of `width` CSS pixels shows. */
type View = {first: number, last: number, width: number};

type LaneEvent = {step: number, id: number, kind: "birth" | "death" | "long miss" | "switch"};

/** Of the mosaic of pictures. */
type Cell = {x: number, y: number, width: number, height: number};

/** Values: what differs from the defaults. */
type Place = {sequence: string | null, step: number | null, selection: number | null, camera: number | null, values: Record<string, any> | null};

type Picture = {bitmap: ImageBitmap | null, missing: string | null};

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
	/** Only the selected track. */
	alone: boolean;
	people: StepResult["truth"];
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
	/** Classes. */
	kind?: string;
	help?: string;
	cell: (row: R) => string | number | Child | Child[];
	/** Makes it sortable. */
	by?: (row: R) => number;
	/** Changes with the shown step. */
	live?: boolean;
}

/** A table. */
interface Grid<R> {
	element: HTMLElement;
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
