/** Building and filling elements. */

/**
 * An element with attributes and children. `on…` is a listener, `class` and the rest are
 * attributes; `true` sets an empty one, `false` and `null` none; `--x` is a style property.
 * @template {keyof HTMLElementTagNameMap} K
 * @param {K} tag
 * @param {Attributes} [attributes]
 * @param {...(Child | Child[])} children
 */
export const h = (tag, attributes, ...children) =>
	furnish(document.createElement(tag), attributes, children);

/**
 * The same of a drawing.
 * @template {keyof SVGElementTagNameMap} K
 * @param {K} tag
 * @param {Attributes} [attributes]
 * @param {...(Child | Child[])} children
 */
export const svg = (tag, attributes, ...children) =>
	furnish(document.createElementNS("http://www.w3.org/2000/svg", tag), attributes, children);

/**
 * @template {HTMLElement | SVGElement} E
 * @param {E} element @param {Attributes} attributes @param {(Child | Child[])[]} children
 */
function furnish(element, attributes = {}, children) {
	for (const [name, value] of Object.entries(attributes)) {
		if (value === null || value === undefined || value === false) continue;
		if (name.startsWith("on"))
			element.addEventListener(name.slice(2), /** @type {EventListener} */ (value));
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
	const made = [...h("select", {}, ...children).childNodes];
	const there = select.childNodes;
	if (made.length !== there.length || made.some((node, k) => !node.isEqualNode(there[k])))
		select.replaceChildren(...made);
}

/**
 * @param {Element & { value: string }} select
 * @param {[string | number, string][]} choices  values and words
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
	return h("span", { class: "id", "--c": `var(--id-${n})`, "--on-id": `var(--on-${n})` }, id);
}

/** A symbol with indices set low; a method's key is words. @param {string} symbol  such as p_D or σ_z/σ_x */
export function symbolParts(symbol) {
	if (!/^.{1,4}_/.test(symbol)) return [symbol.replaceAll("_", " ")];
	return symbol.split(/_([^/()+]+)/).map((part, k) => (k % 2 ? h("sub", {}, part) : part));
}

/** @param {string} symbol */
export const symbolOf = (symbol, kind = "sym") =>
	h("span", { class: kind }, ...symbolParts(symbol));

/** @param {number} value  @returns {string} as short as it stays readable */
export function show(value) {
	if (Number.isInteger(value)) return String(value);
	return Math.abs(value) < 1e-3
		? value.toExponential().replace("e-", "e−")
		: String(Number(value.toPrecision(5)));
}

/** @param {number} value  @returns {string} a rate, never rounded to nothing: 25, 4.2, 0.043 */
export const rate = (value) =>
	value >= 9.95 ? String(Math.round(value)) : show(Number(value.toPrecision(2)));

/** @param {string} words  @returns {string} as a sentence begins */
export const capital = (words) => words.slice(0, 1).toUpperCase() + words.slice(1);
