// Runs before the first paint, so that the page never flashes in the other theme.
{
	/** @type {string | null} */
	let chosen = null;
	try {
		chosen = localStorage.getItem("theme");
	} catch {
		// Storage may be switched off; the system's wish is a good default then.
	}
	// Dark until somebody chooses otherwise, as the 3D view is: pictures are judged best on it.
	document.documentElement.dataset.theme = chosen ?? "dark";
}
