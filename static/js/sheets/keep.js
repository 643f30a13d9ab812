/**
 * A picture of a pane, as SVG or PNG. What it draws is drawn once more by the same code, its words
 * are written where they stand.
 */
import { writers } from "../draw/canvas.js";
import { all, one } from "../elements/dom.js";
import { save } from "../elements/drawn.js";
import { request } from "../state/api.js";

/* ---------- A brush that writes SVG: the drawing code of the canvases makes a vector picture
   with it. It has what that code uses of a canvas's context, no more. */

const escaped = (/** @type {string} */ text) =>
	text.replace(/[<&"]/g, (sign) => `&#${sign.charCodeAt(0)};`);
const short = (/** @type {number} */ number) => Number(number.toFixed(2));

/** @param {Brush} real  measures texts @returns {Brush & {marks: string[]}} */
function svgBrush(real) {
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
async function recorded(canvases) {
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

/** Of a PNG, pixels a CSS pixel. */
const SHARP = 2;

/**
 * The part of a pane's height in which something is seen: its own, or that of the list that it
 * scrolls in.
 * @param {Element} part
 * @param {Element} pane
 */
function opening(part, pane) {
	let { top, bottom } = pane.getBoundingClientRect();
	for (let owner = part.parentElement; owner && owner !== pane; owner = owner.parentElement) {
		if (getComputedStyle(owner).overflowY === "visible") continue;
		const box = owner.getBoundingClientRect();
		[top, bottom] = [Math.max(top, box.top), Math.min(bottom, box.bottom)];
	}
	return { top, bottom };
}

/** @param {Element} pane @param {(canvas: HTMLCanvasElement) => string} drawn @returns {string} */
function svgOf(pane, drawn) {
	const { left, top, width, height } = pane.getBoundingClientRect();
	const head = `<svg xmlns="http://www.w3.org/2000/svg" width="${width}" height="${height}">`;
	const paper = getComputedStyle(pane).backgroundColor;
	const marks = [`<rect width="100%" height="100%" fill="${paper}"/>`];
	for (const canvas of all("canvas", pane)) {
		const box = canvas.getBoundingClientRect();
		if (!canvas.checkVisibility() || !box.width) continue;
		const [x, y] = [box.left - left, box.top - top];
		marks.push(
			`<svg x="${x}" y="${y}" width="${box.width}" height="${box.height}">${drawn(/** @type {any} */ (canvas))}</svg>`,
		);
	}
	for (const part of all(".id, .ph, .ph b, .cam-tag, [aria-pressed=true]:not(.cam)", pane)) {
		const box = part.getBoundingClientRect();
		const open = opening(part, pane);
		const from = Math.max(box.top, open.top);
		const high = Math.min(box.bottom, open.bottom) - from;
		if (part.checkVisibility() && box.width && high > 0)
			marks.push(
				`<rect x="${box.left - left}" y="${from - top}" width="${box.width}" height="${high}" rx="2" fill="${getComputedStyle(part).backgroundColor}"/>`,
			);
	}
	// What the curves look like, before their names.
	for (const name of all(".lg", pane)) {
		const sign = getComputedStyle(name, "::before");
		if (sign.content === "none" || !name.checkVisibility()) continue;
		const box = name.getBoundingClientRect();
		const [x, y] = [box.left - left, box.top - top + box.height / 2];
		const dash = sign.borderTopStyle === "dashed" ? ' stroke-dasharray="3 2"' : "";
		marks.push(
			`<path d="M${x} ${y}h${parseFloat(sign.width)}" stroke="${sign.borderTopColor}" stroke-width="${parseFloat(sign.borderTopWidth)}"${dash}/>`,
		);
	}
	const texts = document.createTreeWalker(pane, NodeFilter.SHOW_TEXT);
	const range = document.createRange();
	for (let node = texts.nextNode(); node; node = texts.nextNode()) {
		const owner = node.parentElement;
		range.selectNodeContents(node);
		const box = range.getBoundingClientRect();
		if (!owner?.checkVisibility() || box.width < 2 || box.right > left + width) continue;
		const [open, middle] = [opening(owner, pane), box.top + box.height / 2];
		if (middle < open.top || middle > open.bottom || owner.closest("option, .vh")) continue;
		const { color, fontSize, fontWeight, fontFamily } = getComputedStyle(owner);
		const words = (node.textContent ?? "").replace(/\s+/g, " ");
		marks.push(
			`<text x="${box.left - left}" y="${box.top - top + box.height / 2}" dy="0.35em" fill="${color}" style="white-space:pre" font-size="${fontSize}" font-weight="${fontWeight}" font-family='${fontFamily}'>${words.replace(/[<&]/g, (sign) => `&#${sign.charCodeAt(0)};`)}</text>`,
		);
	}
	return `${head}${marks.join("\n")}</svg>`;
}

/** @param {Context} context */
export function mountKeep({ store, actions }) {
	/** @param {Blob} png */
	async function copy(png) {
		try {
			await navigator.clipboard.write([new ClipboardItem({ [png.type]: png })]);
			actions.note("info", "The picture is copied", "");
		} catch {
			actions.note(
				"warn",
				"The browser does not let the page use the clipboard",
				"The same picture can be saved: Ctrl+K, picture.",
			);
		}
	}

	/** The 3D view, as the browser draws it once more for the server. @param {string} kind */
	async function keepView(kind) {
		const { offsetWidth: width, offsetHeight: height } = one(".stage");
		actions.note("info", "The 3D view is drawn", "It is there in a moment.");
		const answer = await request(`/api/view/picture.png?width=${width}&height=${height}`).catch(
			(error) => error,
		);
		if (answer instanceof Error)
			return actions.note("error", answer.message, /** @type {any} */ (answer).hint ?? "");
		const { sequence, shown } = store.get();
		const png = await answer.blob();
		if (kind === "copy") return copy(png);
		save(png, `${sequence?.name ?? "view"}-3d-${Math.max(0, shown)}.png`);
	}

	actions.keepPicture = async (what) => {
		const [name, kind] = what.split(" ");
		const pane = one(`.${name}`);
		if (name === "view") return keepView(kind);
		const svg = svgOf(pane, await recorded(/** @type {any[]} */ (all("canvas", pane))));
		const { sequence, shown } = store.get();
		const file = `${sequence?.name ?? "pane"}-${name}-${Math.max(0, shown)}.${kind}`;
		const blob = new Blob([svg], { type: "image/svg+xml" });
		if (kind === "svg") return save(blob, file);
		const image = new Image();
		image.src = `data:image/svg+xml;charset=utf-8,${encodeURIComponent(svg)}`;
		await image.decode();
		const canvas = document.createElement("canvas");
		Object.assign(canvas, { width: pane.clientWidth * SHARP, height: pane.clientHeight * SHARP });
		canvas.getContext("2d")?.drawImage(image, 0, 0, canvas.width, canvas.height);
		canvas.toBlob((png) => png && (kind === "copy" ? copy(png) : save(png, file)));
	};
}
