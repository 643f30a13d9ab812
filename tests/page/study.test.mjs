// What the figures of a study are made of.
import assert from "node:assert/strict";
import { test } from "node:test";
import { unbeaten } from "../../static/js/study/figures.js";
import { placeOf } from "../../static/js/study/where.js";
import { lineOf } from "../../static/js/study/words.js";

/** @param {string} key @param {boolean} higher */
const measure = (key, higher) => ({
  name: key,
  of: { key, name: key, help: "", higher, unit: "", digits: 3, of: "run" },
  at: (trial) => trial[key],
});
const trial = (number, error, idf1, vetoed = false) => ({ number, error, idf1, vetoed });

test("the front has those that no other beats in both figures, along the first", () => {
  const trials = [
    trial(0, 0.3, 0.9),
    trial(1, 0.1, 0.5),
    trial(2, 0.2, 0.5), // as good, and further away
    trial(3, 0.2, 0.7),
    trial(4, 0.4, 0.9), // as good, and further away
    trial(5, 0.1, 0.99, true), // nobody may take it
  ];
  const numbers = (higher) =>
    unbeaten(trials, measure("error", higher), measure("idf1", true)).map(({ number }) => number);
  assert.deepEqual(numbers(false), [1, 3, 0]);
  assert.deepEqual(numbers(true), [4]);
  assert.deepEqual(unbeaten([], measure("error", true), measure("idf1", true)), []);
});

test("a study runs at one place: workers of this machine, or a cluster", () => {
  assert.deepEqual(placeOf({ scheduler: null, workers: 3 }), { workers: 3 });
  assert.deepEqual(placeOf({ scheduler: "tcp://a:1", workers: 3 }), { scheduler: "tcp://a:1" });
  assert.deepEqual(placeOf({ scheduler: "", workers: 3 }), { scheduler: "" });
});

test("a study that the time alone ends is told without a number of trials to come", () => {
  const study = { name: "mine", state: "running", done: 3, trials: 60 };
  assert.equal(lineOf(study), "mine  ·  3 of 60 trials, running");
  assert.equal(lineOf({ ...study, trials: null }), "mine  ·  3 trials, running");
});
