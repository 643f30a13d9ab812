/**
 * A picture of a pane, as SVG or PNG. What it draws is drawn once more by the same code, its words
 * are written where they stand.
 */
import { all, one } from "../elements/dom.js";
import { recorded } from "../draw/svg.js";
import { request } from "../state/api.js";

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

/** @param {Blob} blob @param {string} name */
function save(blob, name) {
	const link = document.createElement("a");
	link.href = URL.createObjectURL(blob);
	link.download = name;
	link.click();
	setTimeout(() => URL.revokeObjectURL(link.href), 10000);
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
