declare namespace Server {
	interface Corrections {
		run: string | null;
		file: string;
		problem: string | null;
		corrections: {
			id: string;
			kind: Wish["kind"];
			words: string;
			note: string;
			time: string;
			first: number;
			last: number;
			places: [number, number, number, number][];
			accuracy: number | null;
			name: string | null;
			met: boolean | null;
			why: string;
			tracks: number[];
		}[];
		checked: [number, number][];
		names: Record<string, string>;
		undo: string | null;
		redo: string | null;
	}
	interface DoubtQueue {
		run: string | null;
		complete: boolean;
		how: string;
		answered: number;
		doubts: {
			id: string;
			kind:
				| "exchange"
				| "join"
				| "cut"
				| "crossing"
				| "gap"
				| "short"
				| "ends"
				| "begins"
				| "missing"
				| "fast";
			title: string;
			why: string;
			first: number;
			last: number;
			tracks: number[];
			places: [number, number, number, number][];
			doubt: number;
			stake: number;
			alternatives: { words: string; probability: number; as_it_is: boolean }[];
		}[];
	}
	interface AlternativePreview {
		tracks: { id: number; first: number; positions: ([number, number, number] | null)[] }[];
		spans: { id: number; first: number; last: number; was: number }[];
	}
	interface State {
		corrections: { key: string; count: number; unmet: number };
	}
}
