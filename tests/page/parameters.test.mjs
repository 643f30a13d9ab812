// The table of parameters: where a value stands on its slider, what is found, effects in words.
import assert from "node:assert/strict";
import { test } from "node:test";
import {
  effectOf,
  matches,
  placeOf,
  placesOf,
  valueAt,
} from "../../static/js/inspector/parameters.js";

const linear = { kind: "float", minimum: 0.05, maximum: 1, step: 0.01, log: false };
const log = { kind: "float", minimum: 1e-6, maximum: 0.1, step: null, log: true };
const count = { kind: "int", minimum: 10, maximum: 5000, step: null, log: true };

test("both ends and any value between stand on the slider, and come back", () => {
  for (const [of, values] of [
    [linear, [0.05, 0.95, 1]],
    [log, [1e-6, 1e-4, 0.1]],
    [count, [10, 316, 5000]],
    [{ ...linear, step: null, minimum: 0, maximum: 30 }, [0, 3, 30]],
  ]) {
    const [low, high, step] = placesOf(of, values[1]);
    assert.ok(step > 0 && step < high - low);
    for (const value of values) {
      const place = placeOf(of, value);
      assert.ok(place >= low && place <= high);
      assert.equal(valueAt(of, place), value);
    }
    assert.equal(valueAt(of, low - 1), of.minimum);
    assert.equal(valueAt(of, high + 1), of.maximum);
  }
});

test("a logarithmic slider moves by decades, a whole number stays whole", () => {
  assert.deepEqual(
    placesOf(log, 1e-4).map((place) => Number(place.toFixed(9))),
    [-6, -1, 0.01],
  );
  assert.equal(valueAt(log, -4.005), 9.89e-5);
  assert.equal(valueAt(count, 2.5), 316);
  assert.deepEqual(placesOf({ ...count, log: false, step: 0.5 }, 20), [10, 5000, 1]);
});

test("a slider ends where the one beside the 3D view does, unless its value is further out", () => {
  const essential = { ...linear, slider: [0.5, 0.9, 0.05] };
  assert.deepEqual(placesOf(essential, 0.6), [0.5, 0.9, 0.01]);
  assert.deepEqual(placesOf(essential, 0.2), [0.2, 0.9, 0.01]);
  assert.deepEqual(placesOf({ ...essential, log: true }, 1), [Math.log10(0.5), 0, 0.01]);
});

test("a parameter is found by its name, symbol, key, unit and help, by all words", () => {
  const of = {
    label: "Clutter rate",
    symbol: "λ_c",
    key: "fusion.clutter_rate",
    unit: "1/(camera·step)",
    help: "Expected number of false detections.",
  };
  for (const text of ["clutter", "Λ_C", "fusion rate", "camera", "false DETECTIONS", ""])
    assert.ok(matches(of, text), text);
  assert.ok(!matches(of, "clutter birth"));
});

test("an effect is told with its ends, whether it falls, and its share", () => {
  const curve = { measure: "MOTA", values: [0.2, 0.5, 0.95], whole: true, share: null };
  assert.equal(
    effectOf({ ...curve, scores: [0.913, null, 0.978] }),
    "0.2 … 0.95: MOTA 0.91 … 0.98",
  );
  assert.equal(
    effectOf({ ...curve, scores: [0.95, 0.978, 0.913], share: 0.418 }),
    "0.2 … 0.95: MOTA 0.98 … 0.91, 42 % of the variance",
  );
  assert.equal(
    effectOf({ measure: "tracks", values: [1, 2], scores: [4, 4], whole: false, share: null }),
    "1 … 2: tracks 4 throughout, computing",
  );
  assert.equal(effectOf({ ...curve, scores: [null, null] }), "no run with other values");
});
