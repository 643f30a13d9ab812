/** The check of identities without truth: begun, watched and stopped. */
import { getJson } from "../state/api.js";

const ASKS_MS = 400;

/** @param {Context} context */
export function mountIdentity({ store, actions }) {
	let watching = false;

	async function watch() {
		if (watching) return;
		watching = true;
		for (;;) {
			/** @type {Server.IdentityInfo | null} */
			const identity = await getJson("/api/identity").catch(() => null);
			if (identity) store.set({ identity });
			if (identity?.state !== "looking") break;
			await new Promise((resolve) => setTimeout(resolve, ASKS_MS));
		}
		watching = false;
	}

	actions.checkIdentities = async (what) => {
		const told = await actions.ask(what === "stop" ? "DELETE" : "POST", "identity");
		if (!told) return;
		store.set({ identity: told });
		void watch();
	};
	// It may have been begun in another window, or before this page was loaded; lanes come first.
	let heard = "";
	store.watch(["timeline", "tab"], ({ timeline, tab }) => {
		const now = `${timeline?.run} ${tab}`;
		if (!timeline || now === heard) return;
		heard = now;
		void watch();
	});
}
