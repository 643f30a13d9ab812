/** The braid of identities: who is followed by which track, and where that changes. */
import { bucketOf, xOf } from "../play/clock.js";
import { stroke } from "../draw/canvas.js";

/**
 * By which track each person is followed, from switch to switch.
 * @param {Server.PersonInfo[]} people
 * @param {Server.Switch[]} switches
 * @returns {{person: number, own: number, parts: {from: number, to: number, track: number}[]}[]}
 * those that are followed at all; `own` is the track that stands for the person
 */
export function strands(people, switches) {
	return people.flatMap(({ id, first, last, track }) => {
		if (track === null) return [];
		const own = switches.filter(({ person }) => person === id).sort((a, b) => a.step - b.step);
		const starts = [first, ...own.map(({ step }) => step)];
		const tracks = [own[0]?.before ?? track, ...own.map((one) => one.track)];
		const parts = starts.map((from, k) => ({ from, to: starts[k + 1] ?? last, track: tracks[k] }));
		return [{ person: id, own: track, parts }];
	});
}

/**
 * A line a person, at the height of the track that follows him and in the colour of the track
 * that stands for him: where two exchange their tracks, their lines cross.
 * @param {Pen} pen
 * @param {Server.Scores} scores
 * @param {Server.TrackLife[]} tracks  in the order of the lanes
 * @param {number | null} selection  whose strands stand out
 */
export function drawBraid({ g, row, view, ink }, { evaluation, series }, tracks, selection) {
	const all = strands(evaluation.per_person, series.switches);
	const carrying = new Set(all.flatMap(({ parts }) => parts.map(({ track }) => track)));
	const order = tracks.map(({ id }) => id).filter((id) => carrying.has(id));
	const apart = (row.height - 12) / Math.max(1, order.length - 1);
	const level = (/** @type {number} */ id) => row.y + 6 + Math.max(0, order.indexOf(id)) * apart;
	g.save();
	g.beginPath();
	g.rect(0, row.y, view.width, row.height);
	g.clip();
	for (const { person, own, parts } of all) {
		const course = series.errors.find((one) => one.person === person);
		const near = { first: course?.first ?? 0, stride: series.stride };
		const paired = (/** @type {number} */ step) =>
			(course?.values[bucketOf(step, near)] ?? null) !== null;
		for (const lost of [true, false]) {
			g.beginPath();
			parts.forEach(({ from, to, track }, k) => {
				const y = level(track);
				const [x0, x1] = [Math.max(0, xOf(from, view)), Math.min(view.width, xOf(to, view))];
				// Over to the next lane within a few pixels, as a strand goes over another.
				if (k && !lost) {
					g.moveTo(x0 - 4, level(parts[k - 1].track));
					g.lineTo(x0 + 4, y);
				}
				const slope = (view.last - view.first) / view.width;
				for (let x = x0, open = false; x < x1; x += 1) {
					const here = paired(Math.round(view.first + x * slope)) !== lost;
					if (here) g[open ? "lineTo" : "moveTo"](x, y);
					open = here;
				}
			});
			const meant = selection === null || parts.some(({ track }) => track === selection);
			g.globalAlpha = meant ? 1 : 0.25;
			stroke(g, ink.id(own), lost ? 0.75 : order.length > 12 ? 1 : 2, lost ? [1, 3] : []);
		}
	}
	g.restore();
}
