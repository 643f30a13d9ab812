// How Check and the library word things.
import assert from "node:assert/strict";
import { test } from "node:test";
import { distinct, unbroken } from "../../static/js/check/words.js";
import { livesAMinute } from "../../static/js/library/words.js";

test("a number and its unit stay on one line, other words do not", () => {
  assert.equal(
    unbroken("2 begins 0.1 m away, 1.5 s later"),
    "2 begins 0.1\u00a0m away, 1.5\u00a0s later",
  );
  assert.equal(unbroken("97 % of 3 metres"), "97\u00a0% of 3 metres");
});

test("alternatives with the same words are offered once: the likeliest, or the one that is shown", () => {
  const named = ["as it is", "exchanged with 3", "exchanged with 3", "two people"];
  const doubt = { alternatives: named.map((words) => ({ words })) };
  const places = (shown) => distinct(doubt, shown).map(([, k]) => k);
  assert.deepEqual(places(0), [0, 1, 3]);
  assert.deepEqual(places(2), [0, 2, 3]);
});

test("tracks a minute are of the recording's time, and unknown without a rate", () => {
  assert.equal(livesAMinute({ targets: 4, steps: 750 }, 25), 8);
  assert.equal(livesAMinute({ targets: 4, steps: 750 }, 0), null);
  assert.equal(livesAMinute({ targets: 0, steps: 0 }, 25), null);
});
