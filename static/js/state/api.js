/** The way to the server: requests with one error shape, and a socket that comes back by itself. */

/** A failure told by the server (RFC 9457), or a server that cannot be reached. */
export class ApiError extends Error {
	/** @param {number} status  0 where no answer came @param {ApiFailure} failure */
	constructor(status, failure) {
		super(failure.detail);
		this.status = status;
		this.code = failure.code;
		this.hint = failure.hint;
	}
}

/** @param {Response} response */
async function failureOf(response) {
	const failure = await response.json().catch(() => null);
	if (failure?.detail) return new ApiError(response.status, failure);
	// A proxy's or a crash's: the status has to do.
	return new ApiError(response.status, {
		code: "http",
		detail: `The server answered ${response.status} ${response.statusText}.`,
		hint: "The terminal that runs multiview-phd says more.",
	});
}

/** @param {string} path @param {RequestInit} [options] */
export async function request(path, options) {
	/** @type {Response} */
	let response;
	try {
		response = await fetch(path, options);
	} catch (error) {
		if (error instanceof DOMException && error.name === "AbortError") throw error;
		throw new ApiError(0, {
			code: "unreachable",
			detail: "The server cannot be reached.",
		});
	}
	if (!response.ok) throw await failureOf(response);
	return response;
}

/** @param {string} path @param {RequestInit} [options] */
export async function getJson(path, options) {
	return (await request(path, options)).json();
}

/**
 * What is answered; null where that is nothing.
 * @param {"POST" | "PUT" | "PATCH" | "DELETE"} method @param {string} path @param {object} [body]
 */
export async function sendJson(method, path, body = {}) {
	const headers = { "Content-Type": "application/json" };
	const answer = await request(path, { method, headers, body: JSON.stringify(body) });
	return answer.status === 204 ? null : answer.json();
}

/** Have the server do something. @param {string} name @param {object} [fields] */
export const sendCommand = (name, fields) => sendJson("POST", "/api/commands", { name, ...fields });

/**
 * Fetch the newest: never twice at once, and once more where there was news meanwhile.
 * @param {() => Promise<void>} work
 * @param {() => number} [rest]  the least time between two, by now, milliseconds
 */
export function fetcher(work, rest = () => 150) {
	let busy = false;
	let again = false;
	return async () => {
		again = true;
		if (busy) return;
		busy = true;
		while (again) {
			again = false;
			try {
				await work();
			} catch {
				// The socket tells whether the server is there, and brings the next news.
			}
			// What the rest depends on may change while it lasts.
			for (const since = performance.now(); performance.now() - since < rest();)
				await new Promise((resolve) => setTimeout(resolve, 100));
		}
		busy = false;
	};
}

/**
 * How long to wait before the next try: quickly at first, then every few seconds.
 * @param {number} tries  failed so far
 * @returns {number} milliseconds
 */
function backoff(tries) {
	return Math.min(5000, 300 * 2 ** Math.min(10, tries));
}

/**
 * A WebSocket that reconnects.
 * @param {string} path
 * @param {object} on
 * @param {() => void} on.open
 * @param {(retryAt: number) => void} on.lost  told after each failed try, with the time of the next
 * @param {(message: any) => void} on.message
 * @returns {{send: (message: object) => boolean, retry: () => void}}
 */
export function openStream(path, on) {
	/** @type {WebSocket | null} */
	let socket = null;
	let tries = 0;
	/** @type {Timer} */
	let timer;

	function connect() {
		clearTimeout(timer);
		const address = new URL(path, location.href);
		address.protocol = address.protocol === "https:" ? "wss:" : "ws:";
		const current = new WebSocket(address);
		socket = current;
		current.onopen = () => {
			tries = 0;
			on.open();
		};
		current.onmessage = (event) => on.message(JSON.parse(event.data));
		current.onclose = () => {
			if (socket !== current) return;
			socket = null;
			const wait = backoff(tries);
			tries += 1;
			timer = setTimeout(connect, wait);
			on.lost(Date.now() + wait);
			// Started anew it wants another token.
			fetch(path).then(
				({ status }) => status === 401 && location.reload(),
				() => {},
			);
		};
	}

	connect();
	setInterval(() => {
		if (socket?.readyState === WebSocket.OPEN) socket.send('{"type":"ping"}');
	}, 20000);
	return {
		send(message) {
			if (socket?.readyState !== WebSocket.OPEN) return false;
			socket.send(JSON.stringify(message));
			return true;
		},
		retry() {
			if (!socket) connect();
		},
	};
}
