// Runs before the first paint, so that the page never flashes in the other theme.
{
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
