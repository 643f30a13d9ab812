/** Results of steps from the server: those that are asked for at once come by one request. */
import { getJson } from "../state/api.js";

/** @typedef {{ resolve: (result: Server.Step) => void, reject: (error: unknown) => void }} Waiting */

/** @returns {(step: number, query: string, signal: AbortSignal) => Promise<Server.Step>} */
export function createStepLoader() {
	/** By what is asked for besides the step.  @type {Map<string, Map<number, Waiting>>} */
	let asked = new Map();

	function send() {
		const now = asked;
		asked = new Map();
		for (const [query, waiting] of now) if (waiting.size) void load(query, waiting);
	}

	/** @param {string} query @param {Map<number, Waiting>} waiting */
	async function load(query, waiting) {
		const steps = [...waiting.keys()].map((step) => `step=${step}`);
		try {
			/** @type {Server.Step[]} */
			const results = await getJson(`/api/steps?${steps.join("&")}${query}`);
			for (const result of results) waiting.get(result.step)?.resolve(result);
		} catch (error) {
			for (const { reject } of waiting.values()) reject(error);
		}
	}

	return (step, query, signal) =>
		new Promise((resolve, reject) => {
			if (asked.size === 0) setTimeout(send, 0);
			const waiting = asked.get(query) ?? new Map();
			asked.set(query, waiting);
			waiting.set(step, { resolve, reject });
			signal.addEventListener("abort", () => {
				waiting.delete(step);
				reject(signal.reason);
			});
		});
}
