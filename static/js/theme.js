// Runs before the first paint, so that the page never flashes in the other theme, and no key that is
// pressed while its modules are read is lost.
{
	/** @type {KeyboardEvent[]} */
	const keys = [];
	const note = (/** @type {KeyboardEvent} */ event) => {
		keys.push(event);
		// The browser has a meaning of its own for these.
		if ((event.ctrlKey || event.metaKey) && /^[kos]$/i.test(event.key)) event.preventDefault();
	};
	addEventListener("keydown", note);
	const takeKeys = () => (removeEventListener("keydown", note), keys);
	Object.assign(document, { takeKeys });

	/** @type {string | null} */
	let chosen = null;
	try {
		chosen = localStorage.getItem("theme");
	} catch {
		// Storage may be switched off; the system's wish is a good default then, as at the first start.
	}
	document.documentElement.dataset.theme =
		chosen ?? (matchMedia("(prefers-color-scheme: light)").matches ? "light" : "dark");
}
