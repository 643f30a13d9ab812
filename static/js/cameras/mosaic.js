/**
 * Where the camera pictures go: one large and the others in a column beside it, or all alike.
 * Every picture keeps its own shape.
 */

/**
 * @param {number[]} aspects  width by height of each camera
 * @param {number | null} large  index of the large one; null for all alike
 * @param {{width: number, most: number, gap: number, sparing?: boolean}} room  `most` is the height
 * that may be used; sparing: what is not used of it is wanted elsewhere
 * @returns {{cells: Cell[], height: number}} cells relative to the mosaic, its height with the gaps
 * around
 */
export function mosaic(aspects, large, { width, most, gap, sparing }) {
	if (aspects.length === 0) return { cells: [], height: 0 };
	const inner = Math.max(1, width - 2 * gap);
	const tall = Math.max(1, most - 2 * gap);
	return large === null || aspects.length === 1 || large >= aspects.length
		? alike(aspects, inner, tall, gap, sparing ? 1.3 : 1)
		: oneLarge(aspects, large, inner, tall, gap);
}

/**
 * In the number of columns that makes the pictures largest: side by side without gaps between
 * them, the last row in the middle where it has fewer.
 * @param {number[]} aspects
 * @param {number} inner
 * @param {number} tall
 * @param {number} gap
 * @param {number} worth  how many times larger pictures must be with another row of them
 */
function alike(aspects, inner, tall, gap, worth) {
	const widest = Math.max(...aspects);
	const grids = aspects.map((_, index) => {
		const columns = index + 1;
		const rows = Math.ceil(aspects.length / columns);
		const width = (inner - gap * (columns - 1)) / columns;
		return { columns, rows, height: Math.min((tall - gap * (rows - 1)) / rows, width / widest) };
	});
	const { columns, rows, height } = grids.reduceRight((best, grid) =>
		grid.height > best.height * worth + 0.5 ? grid : best,
	);
	const width = height * widest;
	const cells = aspects.map((aspect, index) => {
		const row = Math.floor(index / columns);
		const inRow = Math.min(columns, aspects.length - row * columns);
		const left = (inner - inRow * width - (inRow - 1) * gap) / 2;
		return fit(aspect, {
			x: gap + left + (index % columns) * (width + gap),
			y: gap + row * (height + gap),
			width,
			height,
		});
	});
	return { cells, height: Math.round(rows * (height + gap) + gap) };
}

/**
 * @param {number[]} aspects
 * @param {number} large
 * @param {number} inner
 * @param {number} tall
 * @param {number} gap
 */
function oneLarge(aspects, large, inner, tall, gap) {
	const others = aspects.length - 1;
	const rows = others <= 3 ? Math.max(2, others) : Math.ceil(others / 2);
	const columns = Math.ceil(others / rows);
	const small = Math.max(...aspects.filter((_, index) => index !== large));
	// Width = a H + columns (gap + b h), with h = (H - gap (rows - 1)) / rows.
	const wanted =
		(inner - columns * gap + (columns * small * gap * (rows - 1)) / rows) /
		(aspects[large] + (columns * small) / rows);
	const height = Math.min(wanted, tall);
	const cellHeight = (height - gap * (rows - 1)) / rows;
	const bigWidth = aspects[large] * height;
	// No wider than their pictures: what is left of the width lies around all of them.
	const cellWidth = Math.min((inner - bigWidth - columns * gap) / columns, small * cellHeight);
	const begin = gap + (inner - bigWidth - columns * (gap + cellWidth)) / 2;
	const cells = aspects.map((aspect, index) => {
		if (index === large) return fit(aspect, { x: begin, y: gap, width: bigWidth, height });
		const place = index - Number(index > large);
		const x = begin + bigWidth + gap + Math.floor(place / rows) * (cellWidth + gap);
		return fit(aspect, {
			x,
			y: gap + (place % rows) * (cellHeight + gap),
			width: cellWidth,
			height: cellHeight,
		});
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
