/**
 * What the server sends, made from the models of its answers by `python -m app.web.typescript`.
 * Steps are 0-based; boxes are `[left, top, width, height]` in pixels; positions are metres.
 */
declare namespace Server {
	/** What may be true at a doubtful place. */
	interface AlternativeInfo {
		words: string;
		probability: number;
		as_it_is: boolean;
	}

	/** What the tracks would be around a doubtful place, if an alternative were true. */
	interface AlternativePreview {
		tracks: GhostTrack[];
		/** Over the whole recording. */
		spans: ChangedSpan[];
	}

	/** An import that was begun, or a recording that needs none. */
	interface Begun {
		draft: ImportInfo | null;
		/** Number of the first of the files that were announced. */
		first: number;
		/** The folder of a recording that is one already. */
		recording: string;
	}

	/** Something that happened to people in a camera's picture, as its method tells it. */
	interface CameraEvent {
		kind: "new" | "vanished" | "returned" | "occluded" | "merged" | "split";
		/** Labels of the camera's own 2D estimates. */
		labels: number[];
	}

	/** In the picture of one camera, bent as its lens bends what is straight. */
	interface CameraFloor {
		/** Of the grid; what the camera does not see is left out. */
		lines: [number, number][][];
		/** Of the room's floor. */
		edges: [number, number][][];
	}

	/** One camera of the sequence. */
	interface CameraInfo {
		name: string;
		width: number;
		height: number;
		has_pictures: boolean;
		has_detections: boolean;
	}

	/** One camera's reprojected boxes against the truth projected the same way. */
	interface CameraScoreInfo {
		camera: string;
		people: number;
		estimates: number;
		/** Pixels. */
		error: number | null;
		error_95: number | null;
		overlap: number | null;
		found_share: number | null;
		false_per_picture: number | null;
	}

	/** One camera at one step. */
	interface CameraStep {
		name: string;
		measurements: Measurement[];
		estimates: Estimate[];
		/** x, y and relative weight; only where asked for. */
		samples: [number, number, number][] | null;
		/** With the samples. */
		dropped: Candidate[] | null;
		events: CameraEvent[];
		/** Where the method expects its targets, in pixels. */
		gates: [number, number, number, number, number][];
		/** ``?run=`` of the foreground's address; null where the method has none. */
		foreground: string | null;
		/** ``?run=`` of the likelihood map's address; null without pictures or templates. */
		likelihood: string | null;
		tracks: CameraTrack[];
		truth: CameraTruth[];
		/** Numbers of the method worth showing, by name. */
		information: Record<string, number>;
	}

	/** One 3D target as one camera should see it, and what that camera said of it. */
	interface CameraTrack {
		id: number;
		/** Reprojected; null where a part is behind the camera. */
		box: [number, number, number, number] | null;
		/** Whether one of the camera's boxes is associated with it at this step. */
		seen: boolean;
		detection_probability: number;
		/** Index of the associated box among those that the camera gave the fusion, -1 for none. */
		source: number;
		fed_by: Feeding | null;
		/** Id of the target that occludes it; null for none. */
		hidden_by: number | null;
		visible: boolean;
		/** Why it is not, or hardly, visible. */
		reason: "out of view" | "behind camera" | "near the edge" | null;
		centre: [number, number] | null;
		/** Steps from this one, x and y of the feet; only where asked for. */
		trail: [number, number, number][];
	}

	/** Where a person really is in this picture. */
	interface CameraTruth {
		id: number;
		box: [number, number, number, number];
		/** False where the position is not certain. */
		valid: boolean;
	}

	/** What a camera's method looked at and did not believe. */
	interface Candidate {
		box: [number, number, number, number];
		/** At which it fell, in words. */
		gate: string;
	}

	/** A value that is not the recording's default. */
	interface ChangeInfo {
		key: string;
		symbol: string;
		default: string;
		value: string;
	}

	/** A part of a track that would be another's. */
	interface ChangedSpan {
		/** Whose it would be; 0 for nobody's. */
		id: number;
		was: number;
		first: number;
		last: number;
	}

	/** A parameter or method that is not at its default. */
	interface ChangedValue {
		key: string;
		default: any;
		now: any;
	}

	/** What differs from the defaults, and what parameters would change. */
	interface Changes {
		changed: ChangedValue[];
		/** The curves of the parameters that somebody asked for. */
		curves: CurveInfo[];
	}

	/** One side of a comparison. */
	interface ComparedRun {
		run: string;
		steps: number;
		partial: boolean;
		/** Values that are not the default. */
		changed: Record<string, any>;
	}

	/** The shown run against the pinned or the previous one, over the steps that both have. */
	interface Comparison {
		against: "pinned" | "previous";
		/** Steps that both were scored over. */
		steps: number;
		a: ComparedRun;
		b: ComparedRun;
		parameters: ParameterDifference[];
		rows: DifferenceInfo[];
	}

	/** One correction. */
	interface CorrectionInfo {
		id: string;
		kind: "same" | "different" | "exchanged" | "here" | "nobody" | "came" | "left" | "name" | "checked";
		words: string;
		note: string;
		time: string;
		/** Steps that it speaks of, both included. */
		first: number;
		last: number;
		/** Step and world metres. */
		places: [number, number, number, number][];
		accuracy: number | null;
		name: string | null;
		/** By the shown run; null while that is computed. */
		met: boolean | null;
		/** Where it is not met. */
		why: string;
		/** Ids of whom it means in the shown run. */
		tracks: number[];
	}

	/** All of the open recording, in their order. */
	interface Corrections {
		/** Key of the run that they were held against. */
		run: string | null;
		/** Where they are kept. */
		file: string;
		/** Why the file cannot be used: nothing is obeyed then. */
		problem: string | null;
		corrections: CorrectionInfo[];
		/** Ranges of steps that somebody has looked at, without overlap, in order. */
		checked: [number, number][];
		/** Of tracks of the shown run. */
		names: Record<string, string>;
	}

	/** How corrections stand. */
	interface CorrectionsState {
		/** Another for every change of them, or of what became of them: read them again. */
		key: string;
		count: number;
		unmet: number;
	}

	/** Whole numbers over time: of each bucket the lowest, the highest and the mean. */
	interface Counts {
		low: number[];
		high: number[];
		mean: number[];
	}

	/** Where a track went, seen from above. */
	interface Course {
		id: number;
		/** x and y in metres, a few a second. */
		points: [number, number][];
	}

	/** What can be plotted. */
	interface CourseKind {
		name: string;
		word: string;
		help: string;
		needs_truth: boolean;
	}

	/** All of it, in the order of the list. */
	interface CourseKinds {
		kinds: CourseKind[];
	}

	/** Of one track of the shown run, in the buckets that were asked for. */
	interface Courses {
		run: string;
		track: number;
		first: number;
		/** Steps a bucket: a value stands for the mean over them. */
		stride: number;
		courses: TrackCourse[];
	}

	/** What a parameter would change, as far as it is computed. */
	interface CurveInfo {
		key: string;
		/** MOTA; where there is no truth the number of tracks. */
		measure: string;
		/** Ascending, or the choices. */
		values: any[];
		/** One a value; null where the run failed. */
		scores: (number | null)[];
		/** Whether there is nothing more to come. */
		whole: boolean;
		/**
		 * Share of the variance of the measure that the parameter explains alone, among those whose
		 * curves are whole, as studies report it; null where there are not two of them.
		 */
		share: number | null;
	}

	/** What smoothing made otherwise than the filter, and why. */
	interface Decided {
		step: number;
		track: number;
		kind: "cut" | "joined" | "removed";
		words: string;
	}

	/** What was deleted. */
	interface Deleted {
		/** Size of the tracks. */
		bytes: number;
	}

	/** A detection network that is at hand. */
	interface DetectorInfo {
		name: string;
		/** The file that somebody named for this recording; null for a fetched network. */
		path: string | null;
	}

	/** One figure of two runs: A the reference, B the shown run. */
	interface DifferenceInfo {
		name: string;
		label: string;
		unit: string;
		digits: number;
		direction: "higher" | "lower" | "zero" | "none";
		headline: boolean;
		a: number | null;
		b: number | null;
		/** B − A. */
		difference: number | null;
		/** What B is. */
		verdict: "better" | "worse" | "same" | "different" | "undefined";
		/** False where the two were measured with different settings. */
		comparable: boolean;
		settings: string;
	}

	/** A moment at which other ways to look disagree. */
	interface Disagreement {
		step: number;
		ids: number[];
		why: string;
	}

	/** A doubtful place. */
	interface DoubtInfo {
		id: string;
		kind: "exchange" | "join" | "cut" | "crossing" | "gap" | "short" | "begins" | "ends" | "missing" | "fast";
		title: string;
		why: string;
		first: number;
		last: number;
		tracks: number[];
		places: [number, number, number, number][];
		/** Probability that the run is wrong there. */
		doubt: number;
		/** Steps that depend on it. */
		stake: number;
		/** As it is, then the most probable first. */
		alternatives: AlternativeInfo[];
		/**
		 * Of who may be missing, at its places; empty for all others, whose boxes are their tracks'.
		 */
		sights: Sight[];
	}

	/** The doubtful places of the shown run, the most at stake first. */
	interface DoubtQueue {
		run: string | null;
		/** Whether the run is. */
		complete: boolean;
		/** By what they were judged. */
		how: string;
		/** Places that corrections settle. */
		answered: number;
		/** Sentences about cameras whose boxes err more than those of the others. */
		cameras: string[];
		doubts: DoubtInfo[];
	}

	/** What would be undone and redone, in words; null for nothing. */
	interface EditsInfo {
		undo: string | null;
		redo: string | null;
	}

	/** Where people appear: mean and standard deviation. */
	interface EntranceInfo {
		position: [number, number, number];
		sigma: [number, number, number];
	}

	/** A camera's own 2D estimate. */
	interface Estimate {
		box: [number, number, number, number];
		weight: number;
		/** -1 where the method has no labels. */
		label: number;
	}

	/** The shown run against the truth. */
	interface EvaluationInfo {
		run: string;
		/** Steps 0 … ``steps`` − 1 were scored. */
		steps: number;
		/** Whether the run was not finished: steps are missing, or smoothing was still to come. */
		partial: boolean;
		settings: Record<string, any>;
		figures: FigureInfo[];
		per_person: PersonInfo[];
		per_track: ScoredTrackInfo[];
		cameras: CameraScoreInfo[];
		/** What a reader of the figures must know. */
		notes: string[];
		/** How many parameters are not at the defaults of the recording. */
		changes: number;
	}

	/**
	 * A run against the truth over time: one value a bucket of steps. Of a bucket with several steps
	 * the worst is told: that with the greatest OSPA, for GOSPA and its parts that with the greatest
	 * GOSPA, for errors the greatest error.
	 */
	interface EvaluationSeries {
		run: string;
		of: "shown" | "pinned" | "previous";
		steps: number;
		partial: boolean;
		/** The first step of the first bucket. */
		first: number;
		/** Steps a bucket: 1 where each step has its own value. */
		stride: number;
		/** Of the distance: m, or none for boxes. */
		unit: string;
		/** Cut-off and order of OSPA and GOSPA, in words. */
		cost: string;
		/** The gate of errors and switches, in words. */
		gate: string;
		ospa: number[];
		ospa_localisation: number[];
		ospa_cardinality: number[];
		ospa2: number[];
		gospa: number[];
		gospa_localisation: number[];
		gospa_missed: number[];
		/** The parts of GOSPA are p-th powers and sum to its p-th power. */
		gospa_false: number[];
		ospa_share: number[];
		/** How much of each is location, 0 … 1; of GOSPA by its powers. */
		gospa_share: number[];
		/** Metres, over the tracks; null where there is no pair. */
		mean_error: (number | null)[];
		/** Round upper ends for plots; a few spikes leave them. */
		axes: Record<"ospa" | "gospa" | "error", number>;
		truth: number[];
		estimates: number[];
		misses: number[];
		false_positives: number[];
		errors: PersonError[];
		track_errors: TrackError[];
		switches: Switch[];
	}

	/** How far the newest export is. */
	interface ExportInfo {
		/** Counts the files that were asked for. */
		number: number;
		state: "idle" | "writing" | "done" | "failed" | "cancelled";
		format: string;
		/** Of the file. */
		name: string;
		done: number;
		/** 0 while it is not known. */
		total: number;
		error: string | null;
	}

	/** The box associated with a track, as the single-view stage gave it to the fusion. */
	interface Feeding {
		box: [number, number, number, number];
		/** Its weight, existence or detector's score. */
		weight: number;
		/** Association probability: that this track made the box, 0 … 1. */
		share: number;
	}

	/** One figure of a run. */
	interface FigureInfo {
		/** Its key. */
		name: string;
		label: string;
		group: string;
		/** Null where it is not defined. */
		value: number | null;
		unit: string;
		/** Decimals that matter. */
		digits: number;
		/** Which values are better. */
		direction: "higher" | "lower" | "zero" | "none";
		help: string;
		/** What it was measured with, in words: distance, gate, cut-off, order, window. */
		settings: string;
		source: string;
		/** Whether a short table shows it. */
		headline: boolean;
	}

	/** Of the open sequence's room. */
	interface Floor {
		/** Metres between two lines. */
		cell: number;
		/** z of the floor, metres. */
		height: number;
		cameras: CameraFloor[];
	}

	/** A form that tracks leave in. */
	interface FormatInfo {
		name: string;
		word: string;
		help: string;
		/** Whether range and speed say how much of it is written. */
		video: boolean;
	}

	/** All forms. */
	interface FormatList {
		formats: FormatInfo[];
	}

	/** A track as it would be. */
	interface GhostTrack {
		id: number;
		first: number;
		/** World metres, one a step from ``first`` on; null where it is not there. */
		positions: ([number, number, number] | null)[];
	}

	/** A group of parameters. */
	interface GroupInfo {
		name: string;
		help: string;
	}

	/** How well people are told apart, as far as the recording alone can say. */
	interface IdentityInfo {
		/** Key of the run that was looked at; empty before the first time. */
		run: string;
		state: "idle" | "looking" | "done" | "failed" | "cancelled";
		done: number;
		/** Steps over all ways to look; 0 while it is not known. */
		total: number;
		error: string | null;
		/** Estimate of IDF1; null until it is done, as all that follows. */
		score: number | null;
		low: number | null;
		/** IDF1 lay between these in nine of ten runs by which the estimate was calibrated. */
		high: number | null;
		/** IDF1 of the run backwards in time by the run as it is. */
		backwards: number | null;
		/** Empty where there is one camera only. */
		witnesses: Witness[];
		/** The most doubtful first. */
		doubts: Disagreement[];
		warning: string;
	}

	/** An import on its way. */
	interface ImportInfo {
		key: string;
		version: number;
		phase: "uploading" | "reading" | "settled" | "failed" | "writing" | "copying" | "written";
		busy: boolean;
		/** What is being looked into. */
		under_way: string;
		error: string;
		/** Why nothing can be written before somebody decides how the files are meant; else empty. */
		undecided: string;
		question: ImportQuestion | null;
		wish: ImportWish;
		/** Bytes. */
		received: number;
		bytes: number;
		/**
		 * The first of them: those that are used, then those that are not for a reason of their own.
		 */
		files: ImportedFile[];
		/** The number of all files. */
		files_there: number;
		/** The number of those that the recording is made of. */
		files_used: number;
		/** Files that were announced and are not yet understood, the first of them. */
		coming: string[];
		/** Labels of pictures and boxes that a camera may be given. */
		offered: string[];
		/** Whether the files were sent by a page. */
		uploaded: boolean;
		home: string;
		/** The name of its folder there, which has no signs that not every file system takes. */
		place: string;
		/** Bytes on the disk of the recordings. */
		free: number;
		fps: number;
		frames: number;
		unit: string;
		up: string;
		pose: string;
		axes: string;
		/** How the four numbers of a box are meant; empty where files differ or have none. */
		boxes: string;
		/** The number of the first frame in files of boxes; empty where there are none. */
		first_index: string;
		/** How rotations given by three angles were taken; empty where there are none. */
		turns: string;
		/** How they may be composed: what is wished, and words; what the names leave open. */
		open_turns: [string, string][];
		room: [[number, number, number], [number, number, number]] | null;
		suggested: [[number, number, number], [number, number, number]] | null;
		half_extents: [number, number, number] | null;
		suggested_half_extents: [number, number, number] | null;
		/** Suggested where tracks of a first run begin and end: position, standard deviations. */
		entrances: [[number, number, number], [number, number, number]][];
		/** What it is tracked with unless somebody wishes otherwise, by what chooses a method. */
		fitting: Record<string, string>;
		/** Methods that cannot work on it, each with the reason. */
		unfit: Record<string, Record<string, string>>;
		/** Bytes, of the files that become its own. */
		copied: number;
		megabytes_per_second: number;
		/** People in the truth; 0 where there is none. */
		truth: number;
		/** Whether every camera has boxes. */
		has_boxes: boolean;
		found: [string, string][];
		told: string[];
		cameras: ImportedCamera[];
		checks: ImportedCheck[];
		pairs: ImportedPair[];
		plan: ImportedPlan | null;
		/** Where it was written. */
		folder: string;
		/** Half width, depth and height of common targets in metres, by their words. */
		sizes: Record<string, [number, number, number]>;
	}

	/** What is asked where the files leave open how they are meant. */
	interface ImportQuestion {
		/** The first part of the interpretation that differs. */
		code: "direction" | "axes" | "layout" | "parts" | "turns" | "order" | "mirrored" | "flipped" | "pixels" | "scene";
		/** In words, the likelier one first. */
		interpretations: [string, string];
		difference: string;
		/** The fields of the sheet that each states, and how. */
		chosen: [string, string];
		/** What decides for each here. */
		wishes: [ImportWish, ImportWish];
	}

	/** What somebody knows better than the files; null and empty: as it was found out. */
	interface ImportWish {
		/** Unit of the calibration, or how many metres one of its units has. */
		unit: "m" | "cm" | "mm" | number | null;
		/** Axis of the calibration's world that points up. */
		up: "x" | "y" | "z" | "-x" | "-y" | "-z" | null;
		/**
		 * What R and t map: points of the world to the camera, points of the camera to the world, the
		 * first with R transposed, as of points in rows, or with the camera's position as t.
		 */
		pose: "world-to-camera" | "camera-to-world" | "transposed" | "position" | null;
		/** Axes of a camera: y down and z ahead, or y up and z back. */
		axes: "opencv" | "opengl" | null;
		/**
		 * How rotations given by three angles are composed: zyx is R = Rz Ry Rx, zyx-inverse its
		 * inverse; vector: they are a rotation vector.
		 */
		turns: string | null;
		/**
		 * What the four numbers of a box are: left, top and size; two corners, x or y first; centre and
		 * size; in pixels, or normalised: as parts of the picture's width and height.
		 */
		boxes: "ltwh" | "xyxy" | "yxyx" | "cxcywh" | null;
		/** Whether boxes are parts of the picture's size. */
		normalised: boolean | null;
		/** Number of the first frame in boxes and truth. */
		first_index: 0 | 1 | null;
		/** Steps a second; those of the videos, unless stated. */
		fps: number | null;
		/**
		 * Take the likeliest interpretation where the files leave open how they are meant, or where
		 * none explains the boxes.
		 */
		accept_best: boolean;
		/** Two cameras whose calibrations are each other's; exchanged in the order given. */
		swap: [string, string][];
		/**
		 * Leave calibrations with the cameras of their names, though boxes may meet better with some of
		 * them exchanged.
		 */
		as_named: boolean;
		/** Cameras of the calibration that are not wanted. */
		left_out: string[];
		/** What cameras are to be called, by their name in the calibration. */
		names: Record<string, string>;
		/** Seconds that are added to the time of every frame, by camera. */
		offsets: Record<string, number>;
		/** The room's lowest and highest corner. */
		room: [[number, number, number], [number, number, number]] | null;
		/** Half width, depth and height of what is tracked, metres. */
		half_extents: [number, number, number] | null;
		/** Of each the position and the standard deviations, metres. */
		entrances: [[number, number, number], [number, number, number]][];
		name: string;
		/** A camera, and the label of a file that is its. */
		files: [string, string][];
		/** What it is to be tracked with; null, or not there: what fits. */
		methods: Record<"single_view" | "fusion_method" | "smoothing_method", string | null>;
		/** Whether what lies elsewhere on the disk is copied, not linked. */
		copy_files: boolean;
	}

	/** How much of the leading figure's variance a parameter explains by itself. */
	interface ImportanceInfo {
		key: string;
		share: number;
		/** Standard deviation, over trials drawn with replacement. */
		spread: number;
	}

	/** A camera with what belongs to it. */
	interface ImportedCamera {
		/** Its name in the calibration. */
		key: string;
		name: string;
		/** Name of the file, or of the folder of pictures; empty where there is none. */
		video: string;
		frames: number;
		fps: number;
		width: number;
		height: number;
		/** The file of its calibration; what it was recognised as, where it is made of several. */
		calibration: string;
		calibration_format: string;
		/** The camera whose calibration it has by its file: its own, unless they are exchanged. */
		calibration_of: string;
		detections: string;
		boxes_format: string;
		boxes_per_step: number;
		/** As it is wished. */
		seconds_late: number;
		/** As it was found, beyond what is wished. */
		offset: ImportedOffset | null;
	}

	/** A check, and what mends it. */
	interface ImportedCheck {
		name: string;
		status: "good" | "warning" | "absent";
		sentence: string;
		/** The field of the sheet and what it should be; empty where there is none. */
		remedy: string;
		/** The wish that mends it; null where nothing here does. */
		mend: ImportWish | null;
		/** The keys of the cameras that do not fit the others, where it is about them. */
		cameras: string[];
	}

	/** A file, or a series of numbered ones, and what it was taken for. */
	interface ImportedFile {
		label: string;
		/** What it was taken for; empty where it is read with another file, or not at all. */
		format: string;
		/** The label of the file that it is read with; empty for the others. */
		read_with: string;
		/** Why it is not used, as far as it is known of the file alone; else empty. */
		why: string;
		/** The number of files. */
		count: number;
		/** The number of them that the recording is made of. */
		used: number;
	}

	/** How late a camera is against the others, as it is now. */
	interface ImportedOffset {
		steps: number;
		seconds: number;
		sharpness: number;
		sure: boolean;
		/** Steps that were tried. */
		offsets: number[];
		/** Of each; null where too little is left to compare. */
		agreement: (number | null)[];
	}

	/** How well the boxes of two cameras meet. */
	interface ImportedPair {
		first: string;
		second: string;
		share: number;
		pixels: number | null;
		odd: boolean;
	}

	/** The room from above, metres. */
	interface ImportedPlan {
		x: number;
		y: number;
		cell: number;
		width: number;
		height: number;
		/** How many cameras see the floor, by cell, rows along y. */
		seen: number[];
		/** Of those that are wished, else of those that are suggested: x, y and how wide they are. */
		entrances: [number, number, number, number][];
		/** x, y, direction and half the angle across, radians. */
		cameras: [number, number, number, number][];
		feet: [number, number][];
	}

	/** A run in the library. */
	interface KeptRunInfo {
		id: number;
		recording: number;
		recording_name: string;
		/** When the run was computed first, seconds since 1970. */
		began: number;
		/** When the same run was computed last, seconds since 1970. */
		latest: number;
		seconds: number;
		steps: number;
		steps_per_second: number;
		single_view: string;
		fusion_method: string;
		changes: ChangeInfo[];
		seed: number;
		/** Its version. */
		program: string;
		/** Whether another version of the program made it: computing it again may give other tracks. */
		older_code: boolean;
		source: string;
		targets: number;
		mota: number | null;
		idf1: number | null;
		hota: number | null;
		ospa: number | null;
		position_error: number | null;
		misses: number | null;
		false_positives: number | null;
		id_switches: number | null;
		name: string;
		star: boolean;
		note: string;
		tags: string[];
		/** How many corrections of a person it obeys. */
		corrected: number;
		/**
		 * The colour templates of the run: name, camera and step of each; null where they are not
		 * known.
		 */
		templates: string[] | null;
		/** Whether its figures were made before it was finished; opening it computes them again. */
		provisional: boolean;
	}

	/** The runs of one recording, the newest first. */
	interface KeptRuns {
		runs: KeptRunInfo[];
	}

	/** The library. */
	interface LibraryInfo {
		file: string;
		bytes: number;
		/** Why nothing is kept and nothing listed but what can be opened. */
		error: string | null;
		read_only: boolean;
		recordings: RecordingInfo[];
	}

	/** A peak or detection that the camera's filter was given. */
	interface Measurement {
		box: [number, number, number, number];
		score: number;
		/** Id of the track that it feeds; null where it is nobody's. */
		track: number | null;
		/** Of one that is nobody's: the track that it is nearest to. */
		nearest: number | null;
		/** And how far that is, in standard deviations of where its box is expected. */
		sigmas: number | null;
		/** And within how many of them a box would have been taken for the track's. */
		gate: number | null;
	}

	/** The chosen methods. */
	interface MethodsInfo {
		single_view: string;
		fusion_method: string;
		smoothing_method: string;
	}

	/** Numbers over time: of each bucket the lowest, the highest and the mean. */
	interface Numbers {
		low: number[];
		high: number[];
		mean: number[];
	}

	/** A figure that trials can be judged by. */
	interface ObjectiveInfo {
		key: string;
		name: string;
		help: string;
		/** Whether more of it is better. */
		higher: boolean;
		unit: string;
		digits: number;
		/** What it needs: a truth, nothing but the run, or other looks at the recording. */
		of: "truth" | "run" | "agreement";
	}

	/** A template that the tracks offer. */
	interface OfferInfo {
		template: TemplateInfo;
		track: number;
		/** What speaks for it. */
		reason: string;
	}

	/** A sequence on its way. */
	interface OpeningInfo {
		name: string;
	}

	/** A parameter that the two runs do not share. */
	interface ParameterDifference {
		key: string;
		a: any;
		b: any;
	}

	/** One parameter: what its row in the table of parameters needs. */
	interface ParameterInfo {
		key: string;
		group: string;
		name: string;
		label: string;
		help: string;
		symbol: string;
		unit: string;
		/** The first stage that a change re-runs. */
		stage: string;
		/** What it is about, such as "Birth". */
		topic: string;
		kind: "float" | "int" | "bool" | "choice";
		default: any;
		minimum: number | null;
		maximum: number | null;
		step: number | null;
		log: boolean;
		choices: string[];
		advanced: boolean;
		/** Among the few that are shown first. */
		essential: boolean;
		/**
		 * The ends of the sliders of an essential one, and the step of the one beside the 3D view; None
		 * for the others.
		 */
		slider: [number, number, number] | null;
	}

	/** One run, finished or not. */
	interface PastRunInfo {
		/** From 1 on. */
		number: number;
		key: string;
		/** Time of day at which it began, as text. */
		at: string;
		/** The sequence's name at that time. */
		sequence: string;
		/** Whether it is of the recording that is open, so that its parameters can be used again. */
		same_recording: boolean;
		single_view: string;
		fusion_method: string;
		state: "idle" | "computing" | "done" | "failed" | "cancelled";
		done: number;
		total: number;
		steps_per_second: number;
		/** How many parameters were not at their defaults. */
		changes: number;
	}

	/** The runs since the server was started, newest first. */
	interface PastRuns {
		runs: PastRunInfo[];
	}

	/** A person's position error over time. */
	interface PersonError {
		person: number;
		/** The first step of the first value's bucket. */
		first: number;
		/** Metres; null where there is no pair. */
		values: (number | null)[];
	}

	/** One person of the truth. */
	interface PersonInfo {
		id: number;
		first: number;
		last: number;
		steps: number;
		/** Steps with a pair. */
		tracked: number;
		status: "mostly tracked" | "partly tracked" | "mostly lost";
		found_share: number;
		/** Metres; null without pairs. */
		mean_error: number | null;
		error_95: number | null;
		switches: number;
		fragmentations: number;
		/** The track that stands for the person in the identity figures. */
		track: number | null;
	}

	/** The pinned run: the A of comparisons. */
	interface PinnedInfo {
		key: string;
		/** Methods and values. */
		parameters: Record<string, any>;
		/** Keys whose value is not the default. */
		changed: string[];
		/** Keys whose value is not the one that the parameters have now. */
		differs: string[];
	}

	/** A track of the pinned run. */
	interface PinnedLife {
		id: number;
		/** What somebody said, or whose colours it has, among people with templates. */
		name: string | null;
		first: number;
		/** Of its whole life. */
		last: number;
		/** Share of its whole life in which a camera saw it. */
		seen: number;
		/** The same share for each camera by itself. */
		cameras: number[];
		/**
		 * Within the steps asked for; ones shorter than ``stride`` are joined with their neighbours.
		 */
		spans: ([number, number, "seen" | "coasting" | "long miss"])[];
		/** The track of the shown run that it is most often paired with. */
		like: number | null;
	}

	/** The pinned run, in the same buckets. */
	interface PinnedTimeline {
		run: string;
		count: Counts;
		tracks: PinnedLife[];
	}

	/** A run in small. */
	interface Preview {
		run: KeptRunInfo;
		frames: number;
		tracks: TrackLife[];
		/** Targets at each of equally many steps, their mean. */
		people: number[];
		/** How many steps a value of :attr:`people` stands for. */
		people_every: number;
		courses: Course[];
		/**
		 * Its mean over equally many steps each, metres; empty without a truth, and where the figures
		 * are provisional.
		 */
		ospa: number[];
		/** How many steps a value of :attr:`ospa` stands for. */
		ospa_every: number;
		/** The room of its recording, where that is open. */
		room: RoomInfo | null;
	}

	/** A parameter, or the choice of a method, with the range that is tried. */
	interface RangeInfo {
		key: string;
		label: string;
		symbol: string;
		unit: string;
		help: string;
		kind: "float" | "int" | "bool" | "choice";
		/** Of its definition. */
		minimum: number | null;
		maximum: number | null;
		low: number | null;
		high: number | null;
		log: boolean;
		/** Of what is no range. */
		choices: any[];
		default: any;
		/** Today's value. */
		now: any;
	}

	/** A recording that can be opened. */
	interface RecordingCard {
		name: string;
		/** What opens it. */
		opens: string;
		kind: "recent" | "folder" | "rendered";
		description: string;
		cameras: number;
		frames: number;
		/** 0 where it is not known before it is opened. */
		fps: number;
		/** Seconds since 1970; 0 where it never was. */
		opened: number;
		/** Address of its picture; empty where there is none yet. */
		picture: string;
		/** Whether it is what is open now. */
		open: boolean;
	}

	/** A recording of which runs are kept, or that can be opened. */
	interface RecordingInfo {
		/** Null where it was never opened: it has no runs. */
		id: number | null;
		/** What opens it. */
		place: string;
		name: string;
		kind: "rendered" | "folder";
		cameras: number;
		frames: number;
		fps: number;
		boxes_only: boolean;
		/** Of its truth; null without one. */
		people: number | null;
		/** Seconds since 1970. */
		opened: number | null;
		runs: number;
		has_thumbnail: boolean;
		/** Why it cannot be opened now. */
		missing: string | null;
	}

	/** What can be opened at once, and what can be imported from the disk. */
	interface Recordings {
		recordings: RecordingCard[];
		/** Below the data folder, that are no recordings yet. */
		folders: string[];
		/** Where recordings go. */
		data: string;
		/** Bytes on that disk. */
		free: number;
		/** Bytes that an upload may have. */
		most: number;
	}

	/** The volume that people are tracked in. */
	interface RoomInfo {
		min: [number, number, number];
		max: [number, number, number];
		entrances: EntranceInfo[];
	}

	/** The run that the parameters ask for. */
	interface RunInfo {
		/** A step or timeline with this key is of these parameters; with another, of earlier ones. */
		key: string;
		state: "idle" | "computing" | "done" | "failed" | "cancelled";
		done: number;
		total: number;
		steps_per_second: number;
		seconds_left: number | null;
		/** The stage under way, and how long nothing was heard of it. */
		message: string;
		error: string | null;
		/** Its number in the library that it was taken from; what the cameras found is not there. */
		kept: number | null;
		/** Whether the people are those of stage 3; else the filter's, as a live system would see. */
		smoothed: boolean;
		/** The key that a computation would have, where older code made what is shown; else empty. */
		stands_for: string;
		/** What its result lacks: pictures that were missing, files that changed. */
		warnings: string[];
	}

	/** What answers at a scheduler's address. */
	interface SchedulerInfo {
		address: string;
		workers: number;
		threads: number;
		machines: string[];
		/** Why it cannot be used. */
		error: string | null;
	}

	/** Every parameter, method and preset. */
	interface Schema {
		groups: GroupInfo[];
		/** What parameters are about, in the order of a filter's step. */
		topics: string[];
		parameters: ParameterInfo[];
		methods: Record<string, string[]>;
		presets: Record<string, Record<string, any>>;
	}

	/** One track against the truth. */
	interface ScoredTrackInfo {
		id: number;
		first: number;
		last: number;
		steps: number;
		/** Steps with a pair. */
		matched: number;
		/** Steps at which it matched a position that is not certain. */
		ignored: number;
		kind: "person" | "false" | "don't care";
		/** With whom it is paired most often. */
		person: number | null;
		/** Share of its steps that it is. */
		person_share: number | null;
		/** To whomever it is paired with, in the unit of the distance. */
		mean_error: number | null;
		/** How often somebody's identity switched to this track. */
		switches: number;
	}

	/** What the page shows of a run against the truth: figures, and what lies over time. */
	interface Scores {
		evaluation: EvaluationInfo;
		series: EvaluationSeries;
		/** The series of the run that it is compared with; null where there is none. */
		reference: EvaluationSeries | null;
	}

	/** A sequence that can be opened. */
	interface SequenceEntryInfo {
		name: string;
		description: string;
		kind: "rendered" | "folder";
		/** The folder that it lies in, whose name need not be that of the recording. */
		folder: string;
		cameras: number | null;
		frames: number | null;
		/** Why it cannot be opened. */
		error: string | null;
	}

	/** The sequence that is open. */
	interface SequenceInfo {
		/** Part of the pictures' addresses; another for every content. */
		key: string;
		name: string;
		/** The name or folder that opens it again. */
		opened_as: string;
		folder: string;
		description: string;
		fps: number;
		frames: number;
		has_pictures: boolean;
		has_detections: boolean;
		has_truth: boolean;
		room: RoomInfo;
		target: TargetInfo;
		cameras: CameraInfo[];
		/** How many colour templates it has. */
		templates: number;
		/** What is odd about it, or was found out because it is not stated. */
		warnings: string[];
	}

	/** What can be opened. */
	interface SequenceList {
		sequences: SequenceEntryInfo[];
	}

	/** Where in a camera's picture somebody would be whom no track has. */
	interface Sight {
		step: number;
		camera: number;
		/** left, top, width, height, pixels. */
		box: [number, number, number, number];
	}

	/** Everything that all pages share, but for the results themselves. */
	interface State {
		/** Another for every start of the server. */
		session: string;
		/** Grows with every change; of two states the larger is the newer. */
		version: number;
		sequence: SequenceInfo | null;
		opening: OpeningInfo | null;
		parameters: Record<string, any>;
		/** Keys whose value is not the default. */
		changed: string[];
		/** Keys that have an effect with what is chosen. */
		shown: string[];
		/** The command that computes the same in a terminal; empty while nothing is open. */
		command: string;
		methods: MethodsInfo;
		/**
		 * Methods that cannot work on the sequence with the values chosen: by ``single_view``,
		 * ``fusion_method`` or ``smoothing_method``, the sentence why by the method's name.
		 */
		unfit: Record<string, Record<string, string>>;
		/** Names of those that a person has saved. */
		presets: string[];
		/** The one whose values the parameters have, built in or saved. */
		preset: string | null;
		playhead: number;
		selection: number | null;
		/** Of the 3D view. */
		layers: Record<string, boolean>;
		trail: Trail;
		/** What the 3D view looks through: a camera's index, from above, or freely. */
		view: number | "top" | null;
		/** Of the 3D view. */
		theme: "dark" | "light";
		run: RunInfo;
		pinned: PinnedInfo | null;
		teaching: TeachingInfo;
		corrections: CorrectionsState;
		edits: EditsInfo;
		/** Grows when kept runs are named, marked, deleted or restored. */
		marks: number;
		/**
		 * By ``export``, ``identity``, or ``import`` and its key. They come over the socket as they go
		 * on, and here as they are when something else is told.
		 */
		tasks: Record<string, Task>;
		viser: ViserInfo;
	}

	/** One step of the shown run; the truth is there whether it is computed or not. */
	interface Step {
		/** Key of the run that it is of; empty where none is shown. */
		run: string;
		/** Of the run's people: a later one has others at steps that were there before. */
		revision: number;
		step: number;
		computed: boolean;
		cameras: CameraStep[];
		tracks: Track[];
		truth: Truth[];
		/** The number of components of the filter; null where only the tracks of a run were stored. */
		components: number | null;
		/** Expected number of people: the sum of the weights; null where only tracks were stored. */
		cardinality: number | null;
	}

	/** Everything of a study but its trials. */
	interface Study {
		info: StudyInfo;
		/** As its file has it. */
		definition: Record<string, any>;
		toml: string;
		objectives: ObjectiveInfo[];
		/** Other figures worth a column, by their keys in those of the trials. */
		beside: ObjectiveInfo[];
		varied: RangeInfo[];
		status: StudyStatus;
		/** Number of the best trial; 0 where nothing is better than the defaults. */
		best: number | null;
		/** Trials that no other beats in all objectives. */
		front: number[];
		/** Empty while there are too few trials. */
		importance: ImportanceInfo[];
		importance_trials: number;
		sentences: string[];
	}

	/** What a study would take. */
	interface StudyCost {
		runs: number;
		/** Null where nothing is known of how long a run takes, or of how many there are at a time. */
		seconds: number | null;
		bytes: number;
		words: string;
		/** Why it would be refused. */
		error: string | null;
	}

	/** A study as it could be defined from what is open. */
	interface StudyDraft {
		/** One that is free. */
		name: string;
		recordings: string[];
		has_truth: boolean;
		parameters: RangeInfo[];
		/** Those that it would have. */
		objectives: string[];
		/** Those that it could have. */
		choices: ObjectiveInfo[];
		/** Cores of the machine. */
		workers: number;
		/** What is not in the study though it is on the screen; empty for nothing. */
		words: string;
	}

	/** A study in a line. */
	interface StudyInfo {
		name: string;
		state: "new" | "running" | "stopped" | "done" | "failed";
		/** What it waits for, or why it ended. */
		words: string;
		/** Trials that ended. */
		done: number;
		/** All there are to be; null where the time alone ends it. */
		trials: number | null;
		/** When it was at work last, seconds since 1970. */
		touched: number;
		seconds_left: number | null;
		/** Name of the leading figure. */
		objective: string;
		/** Its best value. */
		best: number | null;
		default: number | null;
	}

	/** All studies, the one that was at work last first. */
	interface StudyList {
		folder: string;
		studies: StudyInfo[];
	}

	/** What a study does now. */
	interface StudyStatus {
		/** That ended, however often it was started. */
		runs: number;
		/** In which it was at work. */
		seconds: number;
		seconds_left: number | null;
		/** Share of the workers' time in which they worked. */
		busy: number | null;
		workers: WorkerInfo[];
	}

	/** A person's identity switched. */
	interface Switch {
		step: number;
		person: number;
		/** The track until then. */
		before: number;
		track: number;
	}

	/** The upright box around a person. */
	interface TargetInfo {
		half_extents: [number, number, number];
	}

	/** Work in the background: an export, a check of identities, an import, parameters' effects. */
	interface Task {
		/** The number of an export, the key of a run, that of an import, or that of a recording. */
		of: string;
		state: string;
		/** What is done of :attr:`total`; of an import it is the version that can be read. */
		done: number;
		/** Steps or bytes; 0 while it is not known. */
		total: number;
		/** What it makes: the name of a file. */
		words: string;
		error: string | null;
	}

	/** What the open sequence was taught; room, entrances and target are in its state. */
	interface Taught {
		templates: TemplateInfo[];
		/** Null before they are asked for. */
		offers: OfferInfo[] | null;
		/** The single-view method in use. */
		method: string;
		/** A method that looks at templates, where that in use does not. */
		looking: string | null;
		detector: DetectorInfo | null;
		/** Percentage of a network that is being fetched. */
		fetching: number | null;
		/** Half width, depth and height of common targets in metres, by their words. */
		sizes: Record<string, [number, number, number]>;
		/** What the sequence's file does not have, in words. */
		unsaved: string[];
		/** The sequence's file, with its folder. */
		file: string;
		/** Why it can only be saved as a copy; null where it can be saved. */
		read_only: string | null;
		/** The reason why its file is not as it was when opened or saved; null where it is. */
		remark: string | null;
		built_in: boolean;
		/** A folder that is not there yet, to be offered for a copy. */
		copy_to: string;
	}

	/** What the sequence was taught since its file was read. */
	interface TeachingInfo {
		/** Names room and templates as they are. */
		key: string;
		/** Changes that its file does not have. */
		unsaved: number;
		/** Whether the 3D view has handles on the room. */
		editing_room: boolean;
	}

	/** A box whose colours model a person. */
	interface TemplateInfo {
		name: string;
		/** The camera's name. */
		camera: string;
		step: number;
		box: [number, number, number, number];
	}

	/** The shown run over time, as far as it is computed, summed up in buckets of steps. */
	interface Timeline {
		run: string;
		done: number;
		frames: number;
		/** The first step of the first bucket. */
		first: number;
		/** Steps a bucket: 1 where each step has its own value. */
		stride: number;
		/** Expected number of people. */
		cardinality: Numbers;
		/** Its standard deviation. */
		deviation: Numbers;
		/** Targets reported. */
		count: Counts;
		/** People really there, over all steps asked for. */
		truth: Counts | null;
		/** Those that live in the steps asked for, by id. */
		tracks: TrackLife[];
		/** Where a run is pinned that is not the shown one. */
		pinned: PinnedTimeline | null;
		/** Of all steps, also of those not asked for, in their order. */
		events: ([number, number, "birth" | "death" | "long miss" | "cut" | "joined" | "removed"])[];
		/** What smoothing changed, by its step; empty for the filter alone. */
		decisions: Decided[];
		/** How many more live there: the shorter ones, where they are very many. */
		left_out: number;
	}

	/** One 3D target at one step. */
	interface Track {
		id: number;
		position: [number, number, number];
		sigma: [number, number, number];
		/** Weight or probability of existence. */
		existence: number;
		/** By camera. */
		seen: boolean[];
		/**
		 * Height of the person while standing and its standard deviation, metres; null where it is not
		 * estimated.
		 */
		height: [number, number] | null;
	}

	/** One curve, or one for each camera. */
	interface TrackCourse {
		name: string;
		word: string;
		/** Empty for a share. */
		unit: string;
		help: string;
		/** Value at the lower edge of its plot. */
		low: number;
		/** At its upper edge: a round number. */
		high: number;
		/** Each curve by buckets; null where the track is not there or the value is not known. */
		values: ((number | null)[])[];
		/** Whose the curves are; empty for one that is no camera's. */
		cameras: string[];
	}

	/** A track's distance to whomever it is paired with, over time. */
	interface TrackError {
		track: number;
		first: number;
		values: (number | null)[];
	}

	/** A track's life. */
	interface TrackLife {
		id: number;
		/** What somebody said, or whose colours it has, among people with templates. */
		name: string | null;
		first: number;
		/** Of its whole life. */
		last: number;
		/** Share of its whole life in which a camera saw it. */
		seen: number;
		/** The same share for each camera by itself. */
		cameras: number[];
		/**
		 * Within the steps asked for; ones shorter than ``stride`` are joined with their neighbours.
		 */
		spans: ([number, number, "seen" | "coasting" | "long miss"])[];
	}

	/** How trails are drawn, in 3D and in pictures. */
	interface Trail {
		/** How far back they go. */
		seconds: number;
		/** Whether they are fainter the older they are. */
		fades: boolean;
	}

	/** A trial with its runs and what repeats them. */
	interface TrialDetail {
		trial: TrialInfo;
		runs: TrialRun[];
		commands: string[];
	}

	/** A trial that ended. */
	interface TrialInfo {
		number: number;
		state: "complete" | "pruned" | "failed";
		values: Record<string, any>;
		/** Over recordings and seeds; null where it failed. */
		objectives: number[] | null;
		/** Of each over the seeds. */
		spreads: (number | null)[];
		figures: Record<string, number>;
		/** Whether people overlap too little with the cameras that were left out. */
		vetoed: boolean;
		words: string;
		/** Of its runs. */
		seconds: number;
		/** Seconds since 1970. */
		ended: number;
	}

	/** Trials that ended after a moment. */
	interface TrialList {
		trials: TrialInfo[];
		/** To be given as `after` the next time. */
		last: number;
	}

	/** One run of a trial. */
	interface TrialRun {
		/** Hash of recording, values, seed and code. */
		key: string;
		recording: string;
		seed: number;
		figures: Record<string, number | null>;
		seconds: number;
		worker: string;
		machine: string;
		/** Hash of its tracks. */
		tracks: string;
	}

	/** Where a person really is. */
	interface Truth {
		id: number;
		position: [number, number, number];
		valid: boolean;
		/** The track that is this person's at this step. */
		track: number | null;
		/** How far that is away, metres. */
		error: number | null;
	}

	/** What a study proposes at its end. */
	interface Tuned {
		/** Whether the best were measured again; all else is empty before. */
		done: boolean;
		/** Whether anything better was found than where somebody was. */
		better: boolean;
		words: string;
		/** Of the same values; null where changes that bring nothing were put back. */
		trial: number | null;
		seeds: number[];
		rows: TunedRow[];
		figures: TunedFigure[];
	}

	/** A figure of the proposal, on the seeds that no trial had. */
	interface TunedFigure {
		key: string;
		name: string;
		default: number | null;
		before: number | null;
		after: number | null;
	}

	/** A parameter that the proposal changes. */
	interface TunedRow {
		key: string;
		symbol: string;
		unit: string;
		default: any;
		before: any;
		after: any;
		/** Of the leading figure, against the proposal without it; null where the time was over. */
		brought: number | null;
	}

	/** Where the 3D view is. */
	interface ViserInfo {
		path: string;
	}

	/** What leaving one camera out says. */
	interface Witness {
		camera: string;
		/** IDF1 of the others alone by all of them. */
		agreed: number;
		/** Mean overlap of its boxes with the people whom the others found; null without both. */
		overlap: number | null;
	}

	/** A worker of a study that runs. */
	interface WorkerInfo {
		name: string;
		machine: string;
		/** What it waits for; empty while it works on a run. */
		words: string;
		trial: number | null;
		recording: string | null;
		seed: number | null;
		/** Seconds since 1970. */
		since: number;
	}
}
