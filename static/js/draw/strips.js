// @ts-check
/** Plots over the steps, under the lanes and on the same axis. */
import { xOf } from "../clock.js";
import { stroke } from "./canvas.js";

/**
 * @typedef {import("../clock.js").View} View
 * @typedef {import("../palette.js").Palette} Palette
 * @typedef {{y: number, height: number}} Row
 */

/**
 * A staircase: numbers of people hold for a whole step. Of many steps on one pixel the
 * lowest and the highest are drawn, so that a short change never disappears.
 *
 * @param {CanvasRenderingContext2D} g
 * @param {Row} row
 * @param {View} view
 * @param {number[]} values
 * @param {number} top  value at the upper edge
 * @param {{colour: string, width: number}} pen
 */
export function drawStairs(g, row, view, values, top, { colour, width }) {
  const first = Math.max(0, Math.floor(view.first));
  const last = Math.min(values.length - 1, Math.ceil(view.last));
  if (last < first) return;
  const level = (/** @type {number} */ value) =>
    row.y + row.height - 4 - (Math.max(0, Math.min(value, top)) / top) * (row.height - 10);
  const perPixel = (view.last - view.first) / Math.max(1, view.width);
  const stride = Math.max(1, Math.floor(perPixel));
  g.beginPath();
  g.moveTo(Math.max(0, xOf(first, view)), level(values[first]));
  for (let step = first; step <= last; step += stride) {
    let low = values[step];
    let high = low;
    for (let k = step + 1; k < Math.min(step + stride, last + 1); k += 1) {
      low = Math.min(low, values[k]);
      high = Math.max(high, values[k]);
    }
    const x = xOf(step, view);
    g.lineTo(x, level(low));
    if (high !== low) g.lineTo(x, level(high));
    g.lineTo(Math.min(view.width, xOf(Math.min(step + stride, last), view)), level(values[Math.min(step + stride - 1, last)]));
  }
  stroke(g, colour, width);
}

/**
 * Number of people: truth broad and grey, the reported targets thin over it.
 *
 * @param {CanvasRenderingContext2D} g
 * @param {Row} row
 * @param {View} view
 * @param {{count: number[], truth: number[] | null}} data
 * @param {Palette} ink
 */
export function drawCardinality(g, row, view, { count, truth }, ink) {
  g.beginPath();
  g.moveTo(0, row.y + 0.5);
  g.lineTo(view.width + 20, row.y + 0.5);
  stroke(g, ink.get("line-0"), 1);
  const top = Math.max(2, ...maximum(count), ...maximum(truth ?? [])) * 1.1;
  g.beginPath();
  g.moveTo(0, row.y + row.height - 3.5);
  g.lineTo(view.width, row.y + row.height - 3.5);
  stroke(g, ink.get("p-grid"), 1);
  if (truth) drawStairs(g, row, view, truth, top, { colour: ink.get("p-truth"), width: 3 });
  drawStairs(g, row, view, count, top, { colour: ink.get("p-est"), width: 1.25 });
}

/**
 * @param {number[]} values
 * @returns {number[]} the largest value, or nothing for none
 */
function maximum(values) {
  let most = -Infinity;
  for (const value of values) most = Math.max(most, value);
  return values.length ? [most] : [];
}
