/**
 * One plain object, changed by `set`, read by everyone. Listeners name the keys they
 * depend on and are told once a turn, however many changes that turn brought.
 */

/**
 * @template {object} T
 * @param {T} initial
 * @param {(turn: () => void) => void} [schedule] when listeners are told; a microtask later by
 * default
 * @returns {Store<T>}
 */
export function createStore(initial, schedule = queueMicrotask) {
	let state = { ...initial };
	/** @type {Set<keyof T>} */
	let pending = new Set();
	/** @type {Set<{keys: (keyof T)[], listener: (state: Readonly<T>) => void}>} */
	const listeners = new Set();

	function flush() {
		const changed = pending;
		pending = new Set();
		for (const { keys, listener } of [...listeners])
			if (keys.some((key) => changed.has(key))) listener(state);
	}

	return {
		get: () => state,
		set(patch) {
			const next = { ...state, ...patch };
			const wasIdle = pending.size === 0;
			for (const key of /** @type {(keyof T)[]} */ (Object.keys(patch))) {
				if (!Object.is(state[key], next[key])) pending.add(key);
			}
			state = next;
			if (wasIdle && pending.size > 0) schedule(flush);
		},
		on(keys, listener) {
			const entry = { keys, listener };
			listeners.add(entry);
			return () => listeners.delete(entry);
		},
		watch(keys, listener) {
			listener(state);
			return this.on(keys, listener);
		},
	};
}
