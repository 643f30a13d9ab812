// What is drawn over a picture: the numbers of a crowd do not hide a small one.
import assert from "node:assert/strict";
import { test } from "node:test";
import { drawOverlay } from "../../static/js/draw/overlay.js";

/** The words that are written over a picture of a width, with so many tracks. */
function written(width, count, { selection = null, hover = null, names = {} } = {}) {
  const words = [];
  const brush = new Proxy(
    { measureText: () => ({ width: 8 }), fillText: (text) => words.push(text) },
    { get: (own, name) => own[name] ?? (() => undefined), set: () => true },
  );
  const tracks = Array.from({ length: count }, (_, k) => ({
    id: k + 1,
    box: [10 * k, 20, 8, 16],
    visible: true,
    seen: true,
    fed_by: null,
    trail: [],
  }));
  const view = { tracks, measurements: [], estimates: [], gates: [], truth: [], samples: null };
  drawOverlay(brush, view, {
    scale: 1,
    width,
    height: 100,
    layers: { boxes: true },
    selection,
    hover,
    pointed: null,
    alone: false,
    names,
    people: [],
    fades: true,
    opacity: 1,
    ink: { get: () => "#fff", id: () => "#123456", on: () => "#fff", font: "sans-serif" },
  });
  return words.map((word) => Number(word) || word).sort((a, b) => a - b);
}

test("a few are numbered in a picture of any size", () => {
  assert.deepEqual(written(150, 3), [1, 2, 3]);
  assert.equal(written(600, 30).length, 30);
});

test("of a crowd in a small picture those alone are numbered that somebody means", () => {
  assert.deepEqual(written(150, 30), []);
  assert.deepEqual(written(150, 30, { selection: 7, hover: 12 }), [7, 12]);
});

test("who was named has the name beside the number", () => {
  assert.deepEqual(written(600, 1, { names: { 1: "Anna" } }), ["1 Anna"]);
  // a small picture has no room for it
  assert.deepEqual(written(150, 1, { names: { 1: "Anna" } }), [1]);
});
