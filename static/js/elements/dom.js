/** Building and filling elements. */

/**
 * An element: its tag with classes, `div.a.b`; attributes, if it has any; children. `on…` is a
 * listener, `class` and the rest are attributes; `true` sets an empty one, `false` and `null` none;
 * `--x` is a style property.
 * @type {Maker<HTMLElementTagNameMap>}
 */
export const h = (/** @type {string} */ tag, /** @type {any[]} */ ...inside) =>
	furnish(document.createElement(tag.split(".", 1)[0]), tag, inside);

/** The same of a drawing. @type {Maker<SVGElementTagNameMap>} */
export const svg = (/** @type {string} */ tag, /** @type {any[]} */ ...inside) =>
	furnish(
		document.createElementNS("http://www.w3.org/2000/svg", tag.split(".", 1)[0]),
		tag,
		inside,
	);

/** @param {any} element @param {string} tag @param {any[]} inside */
function furnish(element, tag, inside) {
	const [, ...classes] = tag.split(".");
	if (classes.length) element.setAttribute("class", classes.join(" "));
	const [attributes, children] =
		inside[0]?.constructor === Object ? [inside[0], inside.slice(1)] : [{}, inside];
	for (const [name, value] of Object.entries(attributes)) {
		if (value === null || value === undefined || value === false) continue;
		if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
		else if (name.startsWith("--")) element.style.setProperty(name, String(value));
		else element.setAttribute(name, value === true ? "" : String(value));
	}
	fill(element, ...children);
	return element;
}

/**
 * Replace what an element holds.
 * @param {Element} element
 * @param {...(Child | Child[])} children
 */
export function fill(element, ...children) {
	const nodes = children
		.flat()
		.filter((child) => child !== null && child !== undefined && child !== false);
	element.replaceChildren(
		.../** @type {(Node | string)[]} */ (nodes.map((n) => (typeof n === "number" ? String(n) : n))),
	);
}

/**
 * Write a text only where it changed: cheap enough for every frame.
 * @param {Node} node
 * @param {string} text
 */
export function write(node, text) {
	if (node.textContent !== text) node.textContent = text;
}

/** Hear of an event before what it happens in does. @type {Capture} */
export const capture = (
	/** @type {EventTarget} */ target,
	/** @type {string} */ kind,
	/** @type {any} */ act,
) => target.addEventListener(kind, act, true);

/** It means nothing else. @param {Event} event */
export function claim(event) {
	event.preventDefault();
	event.stopPropagation();
}

/**
 * The elements of the markup that a selector finds.
 * @param {string} selector
 * @param {ParentNode} [root]
 * @returns {Part[]}
 */
export const all = (selector, root = document) =>
	[...root.querySelectorAll(selector)].map((element) => /** @type {any} */ (element));

/** The one that there is. @param {string} selector @param {ParentNode} [root] */
export const one = (selector, root) => all(selector, root)[0];

/**
 * Those that the markup names with `data-ref`, by that name.
 * @param {ParentNode} root
 * @returns {Record<string, Part>}
 */
export const parts = (root) =>
	Object.fromEntries(all("[data-ref]", root).map((element) => [element.dataset.ref, element]));

/**
 * Let a button or a link be pressed, or not: then its tip says why.
 * @param {Part} control
 * @param {string} why  empty where it can be
 */
export function allow(control, why) {
	if (control.matches("a")) control.ariaDisabled = why ? "true" : null;
	else control.disabled = Boolean(why);
	control.ariaDescription = why || null;
}

/**
 * Replace what a list of choices has where it is others: a list that is open would close.
 * @param {Element} select @param {...(Child | Child[])} children
 */
export function refill(select, ...children) {
	const made = [...h("select", ...children).childNodes];
	const there = select.childNodes;
	if (made.length !== there.length || made.some((node, k) => !node.isEqualNode(there[k])))
		select.replaceChildren(...made);
}

/**
 * @param {Element & { value: string }} select
 * @param {(string | number)[][]} choices  values and words
 * @param {string | number} chosen
 */
export function choices(select, choices, chosen) {
	refill(
		select,
		choices.map(([value, word]) => h("option", { value }, word)),
	);
	select.value = String(chosen);
}

/** @param {string} name  of a symbol in the page  @param {string} [kind]  further classes */
export const icon = (name, kind = "") =>
	svg("svg", { class: `i ${kind}` }, svg("use", { href: `#${name}` }));

/** 1 … 24: colour follows the id and never the rank. @param {number} id */
export const colourIndex = (id) => ((((id - 1) % 24) + 24) % 24) + 1;

/** @param {number} id */
export function idTag(id) {
	const n = colourIndex(id);
	return h("span.id", { "--c": `var(--id-${n})`, "--on-id": `var(--on-${n})` }, id);
}

/** @param {number} value  @returns {string} as short as it stays readable */
export function show(value) {
	if (Number.isInteger(value)) return String(value);
	return Math.abs(value) < 1e-3
		? value.toExponential().replace("e-", "e−")
		: String(Number(value.toPrecision(5)));
}

/**
 * The next one of a list that goes round; of none the first or the last.
 * @template V
 * @param {V[]} list @param {number} index  -1: none @param {number} direction  1 or -1
 */
export const turned = (list, index, direction) =>
	list[(Math.max(index, direction < 0 ? 0 : -1) + direction + list.length) % list.length];

/** What this browser remembers under a name. @param {string} name @param {any} usual  else */
export function remembered(name, usual) {
	try {
		return JSON.parse(localStorage.getItem(name) ?? "null") ?? usual;
	} catch {
		return usual;
	}
}

/** Have it remember; without storage that lasts as long as the page. @param {string} name @param {unknown} value */
export function remember(name, value) {
	try {
		localStorage.setItem(name, JSON.stringify(value));
	} catch {
		// Nothing else changes.
	}
}

/** @param {number} value  @returns {string} a rate, never rounded to nothing: 25, 4.2, 0.043 */
export const rate = (value) =>
	value >= 9.95 ? String(Math.round(value)) : show(Number(value.toPrecision(2)));

/** @param {string} words  @returns {string} as a sentence begins */
export const capital = (words) => words.slice(0, 1).toUpperCase() + words.slice(1);
