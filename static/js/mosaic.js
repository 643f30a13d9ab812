// @ts-check
/**
 * Where the camera pictures go: one large and the others in a column beside it, or all alike.
 * Every picture keeps its own shape.
 */

/**
 * @param {number[]} aspects  width by height of each camera
 * @param {number | null} large  index of the large one; null for all alike
 * @param {{width: number, most: number, gap: number}} room  `most` is the height that may be used
 * @returns {{cells: Cell[], height: number}} cells relative to the mosaic, its height with the gaps around
 */
export function mosaic(aspects, large, { width, most, gap }) {
	if (aspects.length === 0) return { cells: [], height: 0 };
	const inner = Math.max(1, width - 2 * gap);
	const tall = Math.max(1, most - 2 * gap);
	return large === null || aspects.length === 1 || large >= aspects.length
		? alike(aspects, inner, tall, gap)
		: oneLarge(aspects, large, inner, tall, gap);
}

/** @param {number[]} aspects @param {number} inner @param {number} tall @param {number} gap */
function alike(aspects, inner, tall, gap) {
	const columns = Math.ceil(Math.sqrt(aspects.length));
	const rows = Math.ceil(aspects.length / columns);
	const cellHeight = Math.min((tall - gap * (rows - 1)) / rows, (inner - gap * (columns - 1)) / columns / Math.max(...aspects));
	const cellWidth = (inner - gap * (columns - 1)) / columns;
	const cells = aspects.map((aspect, index) => {
		const frame = {
			x: gap + (index % columns) * (cellWidth + gap),
			y: gap + Math.floor(index / columns) * (cellHeight + gap),
			width: cellWidth,
			height: cellHeight,
		};
		return fit(aspect, frame);
	});
	return { cells, height: Math.round(rows * cellHeight + (rows - 1) * gap + 2 * gap) };
}

/** @param {number[]} aspects @param {number} large @param {number} inner @param {number} tall @param {number} gap */
function oneLarge(aspects, large, inner, tall, gap) {
	const others = aspects.length - 1;
	const rows = others <= 3 ? Math.max(2, others) : Math.ceil(others / 2);
	const columns = Math.ceil(others / rows);
	const small = Math.max(...aspects.filter((_, index) => index !== large));
	// Width = a H + columns (gap + b h), with h = (H - gap (rows - 1)) / rows.
	const wanted = (inner - columns * gap + (columns * small * gap * (rows - 1)) / rows) / (aspects[large] + (columns * small) / rows);
	const height = Math.min(wanted, tall);
	const cellHeight = (height - gap * (rows - 1)) / rows;
	const bigWidth = aspects[large] * height;
	const cellWidth = (inner - bigWidth - columns * gap) / columns;
	let place = 0;
	const cells = aspects.map((aspect, index) => {
		if (index === large) return fit(aspect, { x: gap, y: gap, width: bigWidth, height });
		const column = Math.floor(place / rows);
		const row = place % rows;
		place += 1;
		const frame = {
			x: gap + bigWidth + gap + column * (cellWidth + gap),
			y: gap + row * (cellHeight + gap),
			width: cellWidth,
			height: cellHeight,
		};
		return fit(aspect, frame);
	});
	return { cells, height: Math.round(height + 2 * gap) };
}

/**
 * The largest picture of a shape in the middle of a frame, on whole pixels.
 * @param {number} aspect
 * @param {Cell} frame
 */
function fit(aspect, { x, y, width, height }) {
	const w = Math.min(width, height * aspect);
	const hgt = w / aspect;
	return {
		x: Math.round(x + (width - w) / 2),
		y: Math.round(y + (height - hgt) / 2),
		width: Math.round(w),
		height: Math.round(hgt),
	};
}
