// The arithmetic of steps: play, prefetch, axis.
import assert from "node:assert/strict";
import { test } from "node:test";
import * as clock from "../../static/js/play/clock.js";
import { pace } from "../../static/js/panes/view3d.js";

const HOW = { fps: 25, speed: 1, direction: 1, first: 0, last: 99, loop: false };

/** Play for some seconds with frames of the given length; the steps that were reached. */
function play(seconds, frameSeconds, how = HOW, from = 0) {
  const steps = [];
  let now = { step: from, rest: 0 };
  for (let t = 0; t < seconds - 1e-9; t += frameSeconds) {
    const next = clock.advance(now, frameSeconds, how);
    if (next.step !== now.step) steps.push(next.step);
    now = next;
  }
  return steps;
}

test("at normal speed play keeps time and skips nothing", () => {
  for (const frame of [1 / 60, 1 / 30, 1 / 24.5]) {
    const steps = play(2, frame);
    assert.ok(Math.abs(steps.length - 50) <= 2, `${steps.length} steps at ${frame}`);
    steps.forEach((step, index) => assert.equal(step, index + 1));
  }
});

test("slow painting slows play down instead of skipping", () => {
  assert.deepEqual(play(1, 0.2), [1, 2, 3, 4, 5]);
});

test("where real time is wanted, slow painting skips steps and keeps the clock", () => {
  assert.deepEqual(play(1, 0.2, { ...HOW, realTime: true }), [5, 10, 15, 20, 25]);
  const { step } = clock.advance({ step: 10, rest: 0 }, 30, { ...HOW, realTime: true });
  assert.equal(step, 35, "after a pause of the page it does not race either");
});

test("after a pause of the page play does not race", () => {
  const { step, rest } = clock.advance({ step: 10, rest: 0 }, 30, HOW);
  assert.equal(step, 11);
  assert.ok(rest <= 1);
});

test("fast play skips and stays on time, slow play waits", () => {
  assert.equal(play(0.5, 1 / 60, { ...HOW, speed: 8 }).at(-1), 99);
  assert.equal(play(1, 1 / 60, { ...HOW, speed: 0.1 }).length, 2);
});

test("play ends on the last step, or begins again", () => {
  assert.deepEqual(clock.advance({ step: 99, rest: 0.5 }, 1, HOW), {
    step: 99,
    rest: 0,
    ended: true,
  });
  assert.equal(clock.advance({ step: 99, rest: 0 }, 0.05, { ...HOW, loop: true }).step, 0);
  const back = { ...HOW, direction: -1, loop: true, first: 20, last: 40 };
  assert.equal(clock.advance({ step: 20, rest: 0 }, 0.05, back).step, 40);
});

test("the prefetch window begins with the step, looks ahead, and stays inside", () => {
  const how = { frames: 100, fps: 25, speed: 1, direction: 1, most: 50 };
  const steps = clock.prefetchWindow(90, how);
  assert.deepEqual(steps.slice(0, 3), [90, 91, 92]);
  assert.equal(steps.at(-1), 99);
  assert.equal(new Set(steps).size, steps.length);
  assert.equal(clock.prefetchWindow(50, { ...how, direction: -1 })[1], 49);
  assert.equal(clock.prefetchWindow(50, { ...how, most: 3 }).length, 3);
  assert.ok(clock.prefetchWindow(50, { ...how, direction: 0 }).includes(49));
  assert.deepEqual(clock.prefetchWindow(0, { ...how, frames: 0 }), []);
});

test("neighbouring steps join into ranges", () => {
  assert.deepEqual(clock.rangesOf([5, 1, 2, 3, 9, 2]), [
    [1, 3],
    [5, 5],
    [9, 9],
  ]);
  assert.deepEqual(clock.rangesOf([]), []);
});

test("a step and its place on the axis are inverse", () => {
  const view = { first: 40, last: 240, width: 733 };
  for (let step = 40; step <= 240; step += 7)
    assert.equal(clock.stepAt(clock.xOf(step, view), view), step);
  assert.equal(clock.stepAt(-50, view), 40);
  assert.equal(clock.stepAt(9999, view), 240);
  assert.equal(clock.xOf(0, { first: 0, last: 0, width: 100 }), 0);
});

test("zooming keeps the step under the pointer and stays inside", () => {
  let view = { first: 0, last: 999, width: 1000 };
  const before = clock.stepAt(300, view);
  view = clock.zoomed(view, 0.5, 300, 1000);
  assert.ok(Math.abs(clock.stepAt(300, view) - before) <= 1);
  for (let k = 0; k < 20; k += 1) view = clock.zoomed(view, 0.5, 300, 1000);
  assert.ok(view.last - view.first >= 20);
  for (let k = 0; k < 40; k += 1) view = clock.zoomed(view, 2, 700, 1000);
  assert.deepEqual([view.first, view.last], [0, 999]);
  view = clock.panned({ first: 100, last: 200, width: 1000 }, 5000, 1000);
  assert.deepEqual([view.first, view.last], [899, 999]);
});

test("ticks are round and far enough apart", () => {
  for (const last of [30, 100, 1499, 20000]) {
    const view = { first: 0, last, width: 1200 };
    const { major, minor } = clock.tickSteps(view);
    assert.match(String(major), /^[125]0*$/);
    assert.ok(minor >= 1 && minor <= major);
    assert.ok((major / last) * 1200 >= 79);
  }
});

test("a number under the playhead is left out whole, and no other", () => {
  const view = { first: 0, last: 1000, width: 1000 };
  assert.equal(clock.tickSteps(view).major, 100);
  assert.equal(clock.tickUnder(view, 310, 20), 300);
  assert.equal(clock.tickUnder(view, 270, 20), 300);
  for (const between of [250, 332, 268]) assert.equal(clock.tickUnder(view, between, 20), null);
  // at both ends number and plate are moved inward
  assert.equal(clock.tickUnder(view, 0, 20), 0);
  assert.equal(clock.tickUnder(view, 22, 20), 0);
  assert.equal(clock.tickUnder(view, 999, 20), 1000);
  assert.equal(clock.tickUnder({ first: 10, last: 1010, width: 1000 }, 12, 20), null);
});

test("a typed step or time is understood, anything else is not", () => {
  assert.equal(clock.parseStep("264", 25, 1500), 264);
  assert.equal(clock.parseStep(" 10.56 s ", 25, 1500), 264);
  assert.equal(clock.parseStep("10,56s", 25, 1500), 264);
  assert.equal(clock.parseStep("9999", 25, 1500), 1499);
  for (const wrong of ["", "abc", "-3", "1e3", "s"])
    assert.equal(clock.parseStep(wrong, 25, 1500), null);
});

test("the 3D view is left alone longer where steps come late, and sooner again where they do not", () => {
  assert.equal(clock.restOf3d(0, 40, 40), 0);
  const late = clock.restOf3d(0, 90, 40);
  assert.ok(late >= 400);
  assert.ok(clock.restOf3d(late, 90, 40) > late);
  assert.equal(clock.restOf3d(1400, 90, 40), 1500);
  assert.ok(clock.restOf3d(1000, 40, 40) < 1000);
});

test("the 3D view takes a fifth of the time at most where one of its frames holds up the page", () => {
  assert.equal(clock.restAfter3d(16), 0);
  assert.equal(clock.restAfter3d(300), 1000);
  assert.equal(clock.restAfter3d(60_000), 8000);
});

test("who paces another window hears how long the browser was busy with its last frame", async () => {
  const frames = [];
  const view = {
    requestAnimationFrame: (act) => frames.push(act),
    cancelAnimationFrame: () => {},
    addEventListener: () => {},
  };
  const costs = [];
  pace(view, (last, cost) => (costs.push(cost), last));
  const draw = () => frames.splice(0).forEach((act) => act(0));
  view.requestAnimationFrame(() => {});
  draw();
  await new Promise((done) => setTimeout(done, 60));
  draw(); // the browser is ready for another frame only now
  view.requestAnimationFrame(() => {});
  assert.equal(costs[0], 0);
  assert.ok(costs[1] >= 50, `${costs[1]} ms`);
});

test("another window draws no more often than it may, and at once when it is touched", async () => {
  const listeners = {};
  const frames = [];
  const view = {
    requestAnimationFrame: (act) => frames.push(act),
    cancelAnimationFrame: () => {},
    addEventListener: (name, act) => (listeners[name] = act),
  };
  let apart = 0;
  pace(view, (last) => last + apart);
  const drawn = [];
  const draw = () => frames.splice(0).forEach((act) => act(0));
  view.requestAnimationFrame(() => drawn.push("at once"));
  draw();
  apart = 60;
  view.requestAnimationFrame(() => drawn.push("later"));
  const cancelled = view.requestAnimationFrame(() => drawn.push("never"));
  view.cancelAnimationFrame(cancelled);
  draw();
  assert.deepEqual(drawn, ["at once"]);
  await new Promise((done) => setTimeout(done, 90));
  draw();
  assert.deepEqual(drawn, ["at once", "later"]);
  listeners.wheel({});
  view.requestAnimationFrame(() => drawn.push("touched"));
  draw();
  assert.deepEqual(drawn, ["at once", "later", "touched"]);
});
