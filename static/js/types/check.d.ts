/** What the place Check keeps, known in every module; no browser loads it. */

/** What can be said, and gone to, by command. */
type Correcting =
	| "next"
	| "previous"
	| "crossing"
	| "other"
	| "alternative"
	| "confirm"
	| "apply"
	| "skip"
	| "exchange"
	| "split"
	| "join"
	| "nobody"
	| "here"
	| "came"
	| "left"
	| "name"
	| "checked"
	| "menu"
	| "truth";

type Doubt = Server.DoubtQueue["doubts"][number];
type Told = Server.Corrections["corrections"][number];

/** A correction as the page says it: tracks of the shown run, or a place. */
type Wish = {
	kind:
		"same" | "different" | "exchanged" | "here" | "nobody" | "came" | "left" | "name" | "checked";
	step?: number;
	/** Of an exchange: they are exchanged back there. */
	to?: number;
	tracks?: number[];
	clicks?: Click[];
	name?: string;
	first?: number;
	last?: number;
};

/** Where somebody stands in a picture: its pixels. */
type Click = { camera: string; x: number; y: number };

/** The same, and which of the pictures it is. */
type Spot = Click & { index: number };

interface CheckState {
	told: Server.Corrections | null;
	queue: Server.DoubtQueue | null;
	/** The place that is looked at; it stays until another is chosen. */
	chosen: Doubt | null;
	/** Which of its alternatives is shown; 0 is as it is. */
	other: number;
	/** How it would be, of the alternative that is shown. */
	preview: Server.AlternativePreview | null;
	/** Of an exchange, where somebody changed them: from, and where it goes back if it does. */
	ends: [number, number | null] | null;
	/** Somebody says by clicks where a person is. */
	placing: { track: number | null; step: number; clicks: Click[] } | null;
}

interface Check {
	state: Store<CheckState>;
	/** Go to a place of the queue; null is none. */
	choose: (doubt: Doubt | null) => void;
	/** Show an alternative of the chosen place. */
	show: (alternative: number) => void;
	/** Say what is right; whether it was taken. */
	say: (wishes: Wish[]) => Promise<boolean>;
	/** Answer the chosen place. */
	answer: (alternative: number) => Promise<boolean>;
	skip: () => Promise<void>;
	drop: (id: string) => Promise<boolean>;
}
