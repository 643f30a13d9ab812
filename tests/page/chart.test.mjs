// Axes of the page's charts: round ticks, logarithmic ends, from values to pixels and back.
import assert from "node:assert/strict";
import { test } from "node:test";
import { logTicks, roundTicks, scaleOf } from "../../static/js/elements/chart.js";

const words = (ticks) => ticks.map(([, word]) => word);

test("ticks are round, as many as fit, with the digits that tell them apart", () => {
  assert.deepEqual(words(roundTicks([0, 1], 5)), ["0.0", "0.2", "0.4", "0.6", "0.8", "1.0"]);
  assert.deepEqual(words(roundTicks([0.0291, 0.0717], 5)), [
    "0.03",
    "0.04",
    "0.05",
    "0.06",
    "0.07",
  ]);
  assert.deepEqual(words(roundTicks([-1, 1], 4)), ["−1.0", "−0.5", "0.0", "0.5", "1.0"]);
  assert.deepEqual(words(roundTicks([0, 1500], 4)), ["0", "500", "1000", "1500"]);
  assert.deepEqual(words(roundTicks([0, 3e-6], 3)), ["0", "1e−6", "2e−6", "3e−6"]);
});

test("no two ticks of an axis say the same, and all lie on it", () => {
  for (const low of [-7, 0, 0.13, 999])
    for (const span of [1e-4, 0.3, 1, 7, 12345]) {
      const ends = [low, low + span];
      const ticks = roundTicks(ends, 6);
      assert.ok(ticks.length >= 2 && ticks.length <= 7, `${ticks} of ${ends}`);
      assert.equal(new Set(words(ticks)).size, ticks.length, `${ticks}`);
      for (const [value] of ticks)
        assert.ok(value >= low - 1e-6 * span && value <= low + span * (1 + 1e-6), `${value}`);
    }
});

test("an axis without length has no ticks", () => {
  assert.deepEqual(roundTicks([1, 1], 5), []);
  assert.deepEqual(roundTicks([Number.NaN, Number.NaN], 5), []);
  assert.deepEqual(roundTicks([-Infinity, Infinity], 5), []);
});

test("a logarithmic axis names its ends, and the power of ten between where it has room", () => {
  assert.deepEqual(words(logTicks([0.75, 12])), ["0.75", "12"]);
  assert.deepEqual(words(logTicks([0.01, 20])), ["0.01", "1", "20"]);
});

test("a place goes back to its value, and never beyond the ends", () => {
  for (const axis of [{ ends: [2, 8] }, { ends: [0.5, 50], log: true }]) {
    const { at, value } = scaleOf(axis, 40, 240);
    assert.equal(at(axis.ends[0]), 40);
    assert.ok(Math.abs(at(axis.ends[1]) - 240) < 1e-9);
    for (const one of [2, 5, 7.5]) assert.ok(Math.abs(value(at(one)) - one) < 1e-9);
    assert.ok(Math.abs(value(0) - axis.ends[0]) < 1e-9);
    assert.ok(Math.abs(value(999) - axis.ends[1]) < 1e-9);
  }
  assert.equal(
    scaleOf({ ends: [5, 50], log: true }, 0, 10)
      .at(5 * Math.sqrt(10))
      .toFixed(6),
    "5.000000",
  );
});
