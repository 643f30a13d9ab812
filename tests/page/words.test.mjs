// How Check and the library word things.
import assert from "node:assert/strict";
import { test } from "node:test";
import {
  distinct,
  exchangeable,
  joinable,
  unbroken,
  whereIs,
} from "../../static/js/check/words.js";
import {
  livesAMinute,
  madeWhen,
  templateWords,
  whereabouts,
} from "../../static/js/library/words.js";
import { rate } from "../../static/js/elements/dom.js";

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

test("a join is offered first with who comes before or after, the least pause first", () => {
  const tracks = [
    { id: 1, first: 20, last: 40 },
    { id: 2, first: 0, last: 99 },
    { id: 3, first: 60, last: 99 },
    { id: 4, first: 0, last: 18 },
  ];
  const here = { tracks: [1, 2].map((id) => ({ id, position: [id, 0, 1] })) };
  const found = joinable(1, here, tracks, 30);
  assert.deepEqual(
    found.map(({ id, pause }) => [id, pause]),
    [
      [4, 2],
      [3, 20],
      [2, 0],
    ],
  );
  assert.deepEqual(
    found.map((other) => whereIs(other, 30, tracks[0])),
    ["ends 2 steps before its beginning", "begins 20 steps after its end", "1.0 m away"],
  );
});

test("somebody who is there at every step is joined with nobody before or after", () => {
  const tracks = [1, 2].map((id) => ({ id, first: 0, last: 99 }));
  assert.deepEqual(
    joinable(1, null, tracks, 30).map(({ id, pause }) => [id, pause]),
    [[2, 0]],
  );
});

test("only who is there before and after can be exchanged, and else it says why", () => {
  const tracks = [
    { id: 1, first: 0, last: 20 },
    { id: 2, first: 0, last: 60 },
    { id: 3, first: 10, last: 40 },
    { id: 4, first: 50, last: 60 },
  ];
  const at = (id, x) => ({ id, position: [x, 0, 1] });
  const here = { tracks: [at(1, 0), at(2, 5), at(3, 1)] };
  const offered = (id, step) => exchangeable(id, here, tracks, step).found.map((one) => one.id);
  const why = (id, step) => exchangeable(id, here, tracks, step).why;
  assert.deepEqual(offered(1, 15), [3, 2], "the nearest first");
  assert.deepEqual(offered(1, 10), [2], "3 begins there: nothing of it lies before");
  assert.deepEqual(offered(2, 40), [3], "3 ends there: its last step would be another's");
  assert.deepEqual(offered(2, 41), []);
  assert.match(why(2, 41), /Nobody else is there both before step 41/);
  assert.deepEqual(offered(1, 30), [], "who is not there himself is exchanged with nobody");
  assert.match(why(1, 30), /Track 1 is not there at step 30: it is from step 0 to 20/);
  assert.match(why(4, 50), /Track 4 begins at step 50/);
  assert.match(why(9, 5), /Track 9 is not there at step 5\.$/);
  assert.equal(why(1, 15), "");
});

test("recordings of one name are told apart by the end of their paths", () => {
  const of = (name, place) => ({ name, place });
  const found = whereabouts([
    of("take", "/data/monday/take"),
    of("take", "/data/friday/take"),
    of("take", "D:\\old\\friday\\take"),
    of("other", "/data/monday/other"),
  ]);
  assert.deepEqual(Object.fromEntries(found), {
    "/data/monday/take": "…/monday/take",
    "/data/friday/take": "/data/friday/take",
    "D:\\old\\friday\\take": "…/old/friday/take",
  });
});

test("a run that was made again within the same minute says its time once", () => {
  const now = new Date(2026, 10, 27, 12, 0);
  const at = (hour, minute, second) => new Date(2026, 10, 27, hour, minute, second) / 1000;
  const began = at(8, 34, 5);
  assert.equal(madeWhen({ began, latest: began }, now), "08:34");
  assert.equal(madeWhen({ began, latest: at(8, 34, 50) }, now), "08:34");
  assert.equal(madeWhen({ began, latest: at(9, 1, 0) }, now), "08:34, again 09:01");
});

test("runs that differ in their templates say which, and how many each has", () => {
  const [anna, bob] = ["Anna, cam1, step 20", "Bob, cam2, step 7"];
  assert.deepEqual(templateWords([{ templates: [anna, bob] }, { templates: [anna] }]), [
    `2; ${bob}`,
    "1",
  ]);
  assert.deepEqual(templateWords([{ templates: [anna] }, { templates: [anna] }]), ["1", "1"]);
  assert.deepEqual(templateWords([{ templates: [anna] }, { templates: null }]), ["1", "not known"]);
});

test("a rate below one step a second is not told as none", () => {
  assert.deepEqual([123.4, 9.96, 4.24, 0.43, 0.0432].map(rate), [
    "123",
    "10",
    "4.2",
    "0.43",
    "0.043",
  ]);
});
