/**
 * A brush that writes SVG: the drawing code of the canvases makes a vector picture with it. It has
 * what that code uses of a canvas's context, no more.
 */
import { writers } from "./canvas.js";

const escaped = (/** @type {string} */ text) =>
	text.replace(/[<&"]/g, (sign) => `&#${sign.charCodeAt(0)};`);
const short = (/** @type {number} */ number) => Number(number.toFixed(2));

/** @param {Brush} real  measures texts @returns {Brush & {marks: string[]}} */
export function svgBrush(real) {
	const first = { ox: 0, oy: 0, clip: "", fillStyle: "#000", strokeStyle: "#000", lineWidth: 1 };
	const text = { globalAlpha: 1, font: "10px sans-serif", textAlign: "start", textBaseline: "" };
	/** @type {Record<string, any>} */
	const now = { ...first, ...text, dash: [] };
	/** @type {Record<string, any>[]} */
	const stack = [];
	/** @type {string[]} */
	const marks = [];
	let [path, clips] = ["", 0];
	const x = (/** @type {number} */ at) => short(at + now.ox);
	const y = (/** @type {number} */ at) => short(at + now.oy);
	const mark = (/** @type {string} */ tag, /** @type {string} */ rest, body = "") =>
		marks.push(
			`<${tag} ${rest}${now.globalAlpha < 1 ? ` opacity="${short(now.globalAlpha)}"` : ""}${now.clip}>${body}</${tag}>`,
		);
	const inked = (/** @type {string} */ kind, /** @type {string} */ colour) =>
		`${kind}="${escaped(colour)}"`;
	const lined = () =>
		`fill="none" ${inked("stroke", now.strokeStyle)} stroke-width="${now.lineWidth}"` +
		(now.dash.length ? ` stroke-dasharray="${now.dash}"` : "");
	const written = (
		/** @type {string} */ word,
		/** @type {number} */ at,
		/** @type {number} */ up,
	) => {
		const anchor = { center: "middle", right: "end" }[/** @type {string} */ (now.textAlign)];
		const down = now.textBaseline === "middle" ? ' dy="0.35em"' : "";
		return `x="${x(at)}" y="${y(up)}" style="font:${escaped(now.font)}"${anchor ? ` text-anchor="${anchor}"` : ""}${down}`;
	};
	/** What the drawing code calls.  @type {Record<string, (...values: any[]) => any>} */
	const acts = {
		save: () => stack.push({ ...now }),
		restore: () => Object.assign(now, stack.pop()),
		setTransform() {},
		clearRect() {},
		translate: (dx, dy) => {
			now.ox += dx;
			now.oy += dy;
		},
		beginPath: () => (path = ""),
		moveTo: (a, b) => (path += `M${x(a)} ${y(b)}`),
		lineTo: (a, b) => (path += `${path ? "L" : "M"}${x(a)} ${y(b)}`),
		rect: (...[a, b, w, h]) => (path += `M${x(a)} ${y(b)}h${short(w)}v${short(h)}h${short(-w)}z`),
		arc: (...[a, b, r]) => acts.ellipse(a, b, r, r, 0),
		ellipse: (...[a, b, rx, ry, turn]) => {
			const [dx, dy] = [rx * Math.cos(turn), rx * Math.sin(turn)];
			const half = `A${short(rx)} ${short(ry)} ${short((turn * 180) / Math.PI)} 0 1 `;
			path += `M${x(a - dx)} ${y(b - dy)}${half}${x(a + dx)} ${y(b + dy)}${half}${x(a - dx)} ${y(b - dy)}`;
		},
		clip: () => {
			marks.push(`<clipPath id="c${(clips += 1)}"><path d="${path}"${now.clip}/></clipPath>`);
			now.clip = ` clip-path="url(#c${clips})"`;
		},
		fill: () => mark("path", `d="${path}" ${inked("fill", now.fillStyle)}`),
		stroke: () => path && mark("path", `d="${path}" ${lined()}`),
		fillRect: (...[a, b, w, h]) =>
			mark(
				"rect",
				`x="${x(a)}" y="${y(b)}" width="${short(w)}" height="${short(h)}" ${inked("fill", now.fillStyle)}`,
			),
		fillText: (word, a, b) =>
			mark("text", `${written(word, a, b)} ${inked("fill", now.fillStyle)}`, escaped(word)),
		strokeText: (word, a, b) => mark("text", `${written(word, a, b)} ${lined()}`, escaped(word)),
		setLineDash: (dash) => (now.dash = dash),
		measureText: (word) => {
			real.font = now.font;
			return real.measureText(word);
		},
		drawImage: (image, ...[a, b, w, h]) => {
			const copy = document.createElement("canvas");
			Object.assign(copy, { width: image.width, height: image.height });
			copy.getContext("2d")?.drawImage(image, 0, 0);
			mark(
				"image",
				`x="${x(a)}" y="${y(b)}" width="${short(w)}" height="${short(h)}" preserveAspectRatio="none" href="${copy.toDataURL()}"`,
			);
		},
	};
	/** @type {any} */
	const brush = new Proxy(acts, {
		get: (_, name) => acts[String(name)] ?? (name === "marks" ? marks : now[String(name)]),
		set: (_, name, value) => ((now[String(name)] = value), true),
	});
	return brush;
}

/**
 * The canvases of a pane drawn once more, as SVG.
 * @param {HTMLCanvasElement[]} canvases
 * @returns {Promise<(canvas: HTMLCanvasElement) => string>}
 */
export async function recorded(canvases) {
	/** @type {Map<HTMLCanvasElement, string[]>} */
	const found = new Map();
	for (const canvas of canvases)
		writers.set(canvas, (real) => {
			const brush = svgBrush(real);
			found.set(canvas, brush.marks);
			return brush;
		});
	dispatchEvent(new Event("panes"));
	await new Promise((done) => setTimeout(done, 120));
	writers.clear();
	// And back on the screen.
	dispatchEvent(new Event("panes"));
	return (canvas) => (found.get(canvas) ?? []).join("");
}
