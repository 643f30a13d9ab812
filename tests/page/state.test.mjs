// Store, address, cache, events and the places of the pictures.
import assert from "node:assert/strict";
import { test } from "node:test";
import { createCache } from "../../static/js/play/cache.js";
import {
  eventsNow,
  isAlone,
  nextEvent,
  nextLayers,
  ordered,
  resultOf,
  stateAt,
  gateWords,
  viewWords,
} from "../../static/js/state/events.js";
import { lensOf } from "../../static/js/draw/overlay.js";
import { magnified } from "../../static/js/cameras/cameras.js";
import { compareCells } from "../../static/js/elements/table.js";
import { freeCorner } from "../../static/js/opening/plan.js";
import { kindsOf } from "../../static/js/inspector/side.js";
import { strands } from "../../static/js/timeline/reading.js";
import { matching, offersOf, valueOf } from "../../static/js/sheets/sheets.js";
import { mosaic } from "../../static/js/cameras/cameras.js";
import { viewFrom, viewOf } from "../../static/js/state/address.js";
import { createStore } from "../../static/js/state/store.js";
import { readPlace, writePlace } from "../../static/js/state/address.js";

const turn = () => new Promise((resolve) => setImmediate(resolve));

test("the store tells a listener once a turn, of its own keys only", async () => {
  const store = createStore({ step: 0, theme: "dark" });
  const told = [];
  const off = store.on(["step"], ({ step }) => told.push(step));
  store.set({ step: 1 });
  store.set({ step: 2 });
  store.set({ theme: "light" });
  await turn();
  assert.deepEqual(told, [2]);
  store.set({ step: 2 });
  await turn();
  assert.deepEqual(told, [2]);
  off();
  store.set({ step: 3 });
  await turn();
  assert.deepEqual(told, [2]);
});

test("a listener may change the store; that is told in the next turn", async () => {
  const store = createStore({ a: 0, b: 0 });
  const told = [];
  store.on(["a"], ({ a }) => store.set({ b: a * 2 }));
  store.on(["b"], ({ b }) => told.push(b));
  store.set({ a: 4 });
  await turn();
  assert.deepEqual(told, [8]);
});

test("the address round-trips and names what it does not know", () => {
  const place = {
    sequence: "room 44/ü&x",
    step: 264,
    selection: 7,
    camera: 1,
    look: "top",
    view: { tab: "parameters", zoom: "20-90", layers: "boxes.truth" },
    values: { "fusion.detection_probability": "0.6", fusion_method: "sequential_phd" },
    pinned: { "fusion.memory": "2" },
  };
  assert.deepEqual(readPlace(writePlace(place)), { place, unknown: [] });
  const nowhere = { sequence: null, step: null, selection: null, camera: null, look: null };
  const none = { ...nowhere, values: null, pinned: null, view: {} };
  const atDefaults = { ...none, pinned: {} };
  assert.deepEqual(readPlace(writePlace(atDefaults)).place, atDefaults);
  assert.equal(writePlace(none), "");
  assert.equal(writePlace({ ...none, values: {} }), "");
  assert.deepEqual(readPlace(""), { place: none, unknown: [] });
  assert.deepEqual(readPlace("?step=-4&sel=x&cam=0&look=0&zooom=3"), {
    place: none,
    unknown: ["zooom"],
  });
});

test("how it is looked at: only what is not as at first is written, and it is read back", () => {
  const first = viewFrom({});
  const state = { ...first, frames: 100 };
  assert.deepEqual(viewOf(state), {});
  const other = {
    ...state,
    tab: "compare",
    span: [20.4, 80],
    loop: true,
    range: [null, 60],
    speed: 0.5,
    layers2d: { ...first.layers2d, truth: false, samples: true },
    measure: "gospa",
    laneOrder: "born",
    listed: "worst",
    eventKind: "long miss",
    zooms: { 1: [3, 0.25, 0.5] },
    layers3d: { ...first.layers3d, truth: true, volume: false },
  };
  const words = viewOf(other);
  assert.equal(words.layers, "measurements.boxes.samples");
  assert.equal(words.loop, "0-60");
  const back = { ...viewFrom(words), frames: 100 };
  assert.deepEqual(viewOf(back), words);
  // the tab of Check is there alone
  assert.deepEqual(viewOf({ ...state, tab: "place", place: "tune" }), {});
  assert.deepEqual(viewOf({ ...state, tab: "place", place: "check" }), { tab: "place" });
  assert.deepEqual(back.span, [20, 80]);
  assert.deepEqual(back.zooms, other.zooms);
  assert.deepEqual(back.layers3d, other.layers3d);
  // a tab under its name in earlier addresses
  assert.deepEqual(viewOf({ ...viewFrom({ tab: "changes" }), frames: 9 }), { tab: "parameters" });
  const senseless = { tab: "x", zoom: "9-3", speed: "7", loop: "a-b", layers: "none" };
  assert.deepEqual(Object.keys(viewOf({ ...viewFrom(senseless), frames: 9 })), ["layers"]);
});

test("a layer's key comes back to where it began, also where pictures and 3D differed", () => {
  const press = (now, mixed, times) => {
    const seen = [now];
    for (let k = 0; k < times; k += 1) {
      if (now[0] !== now[1] && !now.includes(undefined)) mixed = now;
      seen.push((now = nextLayers(now, mixed)));
    }
    return seen;
  };
  const [on, off, apart] = [
    [true, true],
    [false, false],
    [false, true],
  ];
  assert.deepEqual(press(apart, undefined, 3), [apart, on, off, apart]);
  assert.deepEqual(press(on, undefined, 2), [on, off, on]);
  assert.deepEqual(press([false, undefined], undefined, 2), [
    [false, undefined],
    [true, undefined],
    [false, undefined],
  ]);
});

/** A cache whose requests are answered by hand. */
function manual({ budget = 100, parallel = 2 } = {}) {
  const asked = new Map();
  const disposed = [];
  const arrived = [];
  const cache = createCache({
    load: (name, signal) =>
      new Promise((resolve, reject) => {
        asked.set(name, { resolve: () => resolve({ name, size: 10 }), reject });
        signal.addEventListener("abort", () => reject(new Error("aborted")));
      }),
    sizeOf: ({ size }) => size,
    budget,
    parallel,
    arrived: (name) => arrived.push(name),
    dispose: ({ name }) => disposed.push(name),
    failed: () => undefined,
  });
  return { cache, asked, disposed, arrived };
}

test("the most urgent is asked for first, a few at a time", async () => {
  const { cache, asked, arrived } = manual();
  cache.want(["c", "a", "b"]);
  assert.deepEqual([...asked.keys()], ["c", "a"]);
  asked.get("a").resolve();
  await turn();
  assert.deepEqual([...asked.keys()], ["c", "a", "b"]);
  assert.deepEqual(arrived, ["a"]);
  assert.equal(cache.get("a").name, "a");
  assert.equal(cache.get("c"), undefined);
});

test("what is not wanted any more is aborted and never arrives", async () => {
  const { cache, asked, arrived } = manual();
  cache.want(["old"]);
  const answer = asked.get("old");
  cache.want(["new"]);
  answer.resolve();
  await turn();
  assert.equal(cache.get("old"), undefined);
  asked.get("new").resolve();
  await turn();
  assert.deepEqual(arrived, ["new"]);
});

test("the budget is kept; what is wanted stays, what was used last stays longest", async () => {
  const { cache, disposed } = manual({ budget: 30 });
  for (const name of ["a", "b", "c"]) cache.put(name, { name, size: 10 });
  cache.get("a");
  cache.put("d", { name: "d", size: 10 });
  assert.deepEqual(disposed, ["b"]);
  cache.clear();
  assert.deepEqual([...cache.names()], []);
  assert.equal(disposed.length, 4);
});

const TRACK = {
  id: 3,
  first: 10,
  last: 99,
  seen: 0.5,
  spans: [
    [10, 39, "seen"],
    [40, 79, "long miss"],
    [80, 89, "seen"],
    [90, 99, "coasting"],
  ],
};

test("events: those of the timeline and the switches of the shown run, in order, by kind", () => {
  const timeline = {
    events: [
      [10, 3, "birth"],
      [40, 3, "long miss"],
      [99, 3, "death"],
    ],
  };
  const scores = { series: { run: "r", switches: [{ step: 40, before: 3, track: 1 }] } };
  const state = { timeline, scores, basis: "r", eventKind: "" };
  const events = eventsNow(state);
  assert.deepEqual(
    events.map((e) => [e.step, e.id, e.kind]),
    [
      [10, 3, "birth"],
      [40, 1, "switch"],
      [40, 3, "long miss"],
      [99, 3, "death"],
    ],
  );
  assert.equal(nextEvent(events, 10, 1).step, 40);
  assert.equal(nextEvent(events, 10, -1), undefined);
  assert.equal(nextEvent(events, 200, -1).step, 99);
  assert.deepEqual(
    eventsNow({ ...state, eventKind: "death" }).map((e) => e.step),
    [99],
  );
  assert.equal(eventsNow({ ...state, basis: "another" }).length, 3);
  assert.deepEqual(eventsNow({ timeline: null, scores: null, basis: "", eventKind: "" }), []);
});

test("a result counts where it is of the shown run, a filter where somebody is selected", () => {
  const result = { run: "r", computed: true };
  assert.equal(resultOf({ result, basis: "r" }), result);
  assert.equal(resultOf({ result, basis: "s" }), null);
  assert.equal(resultOf({ result: { run: "r", computed: false }, basis: "r" }), null);
  assert.equal(isAlone({ selection: 2, layers3d: { others: false } }), true);
  assert.equal(isAlone({ selection: null, layers3d: { others: false } }), false);
  assert.equal(isAlone({ selection: 2, layers3d: {} }), false);
});

test("what a track is at a step", () => {
  assert.deepEqual(
    [5, 10, 40, 99, 100].map((step) => stateAt(TRACK, step)),
    ["not yet", "seen", "coasting", "coasting", "ended"],
  );
  assert.equal(
    stateAt(
      {
        id: 1,
        first: 0,
        last: 9,
        spans: [
          [0, 3, "seen"],
          [6, 9, "seen"],
        ],
      },
      5,
    ),
    "lost",
  );
});

test("lanes are ordered by length or birth, and the tracks stay as they were", () => {
  const tracks = [
    [1, 50, 51],
    [2, 10, 90],
    [3, 0, 5],
  ].map(([id, first, last]) => ({ id, first, last, spans: [] }));
  assert.deepEqual(
    ordered(tracks, "longest").map((t) => t.id),
    [2, 3, 1],
  );
  assert.deepEqual(
    ordered(tracks, "born").map((t) => t.id),
    [3, 2, 1],
  );
  assert.deepEqual(
    tracks.map((t) => t.id),
    [1, 2, 3],
  );
  assert.deepEqual(ordered([], "born"), []);
});

test("pictures keep their shape, stay inside and do not overlap", () => {
  for (const count of [1, 2, 3, 4, 5, 7, 9]) {
    for (const large of [null, 0, count - 1]) {
      for (const aspect of [5 / 4, 4 / 3, 16 / 9]) {
        const { cells, height } = mosaic(Array(count).fill(aspect), large, {
          width: 610,
          most: 338,
          gap: 4,
        });
        assert.equal(cells.length, count);
        assert.ok(height <= 340, `${count} cameras: ${height}`);
        for (const [index, a] of cells.entries()) {
          assert.ok(
            a.width > 20 &&
              a.x >= 3 &&
              a.y >= 3 &&
              a.x + a.width <= 608 &&
              a.y + a.height <= height - 2,
          );
          assert.ok(Math.abs(a.width / a.height - aspect) < 0.06);
          for (const b of cells.slice(index + 1)) {
            assert.ok(
              a.x + a.width <= b.x ||
                b.x + b.width <= a.x ||
                a.y + a.height <= b.y ||
                b.y + b.height <= a.y,
            );
          }
        }
      }
    }
  }
  assert.deepEqual(mosaic([], null, { width: 610, most: 338, gap: 4 }), { cells: [], height: 0 });
});

test("pictures that are alike lie side by side, the last row in the middle", () => {
  const { cells } = mosaic([1.25, 1.25, 1.25], null, { width: 1440, most: 800, gap: 4 });
  const [a, b, c] = cells;
  assert.ok(Math.abs(b.x - a.x - a.width - 4) <= 1, "no void between two");
  assert.ok(Math.abs(c.x + c.width / 2 - 720) <= 1);
  assert.ok(Math.abs(a.x + b.x + b.width - 1440) <= 2);
  assert.ok(a.height * 2 + 12 >= 796, "as high as there is room");
  const spare = { width: 473, most: 270, gap: 4, sparing: true };
  const row = mosaic([1.22, 1.22, 1.22], null, spare);
  assert.ok(row.cells.every(({ y }) => y === row.cells[0].y) && row.height < 140);
});

test("of what a camera looked at it is told where it fell", () => {
  assert.deepEqual(gateWords({ cardinality: 2 }), []);
  assert.deepEqual(gateWords({ candidates: 1 }), ["1 candidate, none dropped"]);
  const told = { candidates: 9, "dropped for colour": 6, "dropped for shape": 2, other: 3 };
  assert.deepEqual(gateWords(told), ["9 candidates, 6 dropped for colour, 2 for shape"]);
});

test("what a camera tells of its people is one line of words", () => {
  assert.equal(viewWords([]), "");
  assert.equal(viewWords([{ kind: "new", labels: [7] }]), "7 new");
  const events = [
    { kind: "occluded", labels: [3, 5] },
    { kind: "vanished", labels: [1, 2, 4] },
  ];
  assert.equal(viewWords(events), "3 and 5 occluded, 1, 2 and 4 vanished");
});

test("a picture that is magnified at a point keeps that point in its place", () => {
  const spot = { x: 120, y: 60, width: 400, height: 300 };
  const seen = (zoom, { x, y, width, height }) => {
    const { k, left, top } = lensOf(zoom, width, height);
    return [(x + left) / k, (y + top) / k];
  };
  let zoom;
  for (let k = 0; k < 6; k += 1) {
    const before = seen(zoom, spot);
    zoom = magnified(zoom, 1.5, spot);
    seen(zoom, spot).forEach((at, axis) => assert.ok(Math.abs(at - before[axis]) < 1));
  }
  assert.ok(zoom[0] > 11);
  for (let k = 0; k < 7 && zoom; k += 1) zoom = magnified(zoom, 1 / 1.5, spot);
  assert.equal(zoom, undefined, "out again it is the whole picture");
  const { left, top } = lensOf([4, 0, 1], 400, 300);
  assert.deepEqual([left, top], [0, 900], "it never leaves the picture");
});

test("tracks are listed by what is wrong with them", () => {
  const tracks = Array.from({ length: 10 }, (_, k) => ({ id: k + 1 }));
  const scored = new Map(
    tracks.map(({ id }) => [id, { kind: id > 8 ? "false" : "person", mean_error: id / 10 }]),
  );
  const events = [
    [5, 3, "long miss"],
    [9, 3, "long miss"],
    [7, 4, "death"],
  ];
  const ids = Object.entries(kindsOf(tracks, scored, events)).map(([kind, list]) => [
    kind,
    list.map(({ id }) => id),
  ]);
  assert.deepEqual(Object.fromEntries(ids.slice(1)), {
    false: [9, 10],
    missed: [3],
    worst: [10, 9],
  });
  assert.deepEqual(kindsOf(tracks, new Map(), []).worst, []);
});

test("where two exchange their tracks their strands cross", () => {
  const people = [
    { id: 1, first: 0, last: 99, track: 1 },
    { id: 2, first: 10, last: 99, track: 2 },
    { id: 3, first: 10, last: 20, track: null },
  ];
  const switches = [
    { step: 50, person: 1, before: 1, track: 2 },
    { step: 50, person: 2, before: 2, track: 1 },
    { step: 60, person: 1, before: 2, track: 1 },
  ];
  const found = strands(people, switches);
  assert.deepEqual(
    found.map(({ person, parts }) => [person, parts.map((p) => [p.from, p.to, p.track])]),
    [
      [
        1,
        [
          [0, 50, 1],
          [50, 60, 2],
          [60, 99, 1],
        ],
      ],
      [
        2,
        [
          [10, 50, 2],
          [50, 99, 1],
        ],
      ],
    ],
  );
});

test("the palette takes a value only where it may be one", () => {
  const number = { kind: "float", minimum: 0.1, maximum: 1, choices: [] };
  assert.equal(valueOf(number, " 0,5"), 0.5);
  for (const wrong of ["", "2", "x", "-1"]) assert.equal(valueOf(number, wrong), null);
  assert.equal(valueOf({ ...number, kind: "int", maximum: 9 }, "2.5"), null);
  assert.equal(valueOf({ kind: "bool", choices: [] }, "off"), false);
  assert.equal(valueOf({ kind: "choice", choices: ["soft", "hard"] }, "ha"), "hard");
});

test("of two parameters of one name the palette offers the essential one first", () => {
  const parameters = ["colour_phd", "fusion"].map((group) => ({
    key: `${group}.survival_probability`,
    label: "Survival probability",
    symbol: "p_S",
    group,
    essential: group === "fusion",
  }));
  const asked = [];
  const offers = offersOf(
    {
      sequences: [],
      schema: { parameters },
      server: { shown: parameters.map(({ key }) => key), parameters: {} },
      link: "open",
      layouts: {},
      bookmarks: [],
    },
    {},
    ({ key }) => asked.push(key),
  );
  for (const { run } of matching(offers, "survival")) run();
  assert.deepEqual(asked, ["fusion.survival_probability", "colour_phd.survival_probability"]);
});

test("the palette leads to bookmarks by their notes", () => {
  const by = [];
  const offers = offersOf(
    {
      sequences: [],
      layouts: {},
      link: "open",
      step: 100,
      bookmarks: [{ step: 605, note: "hands meet" }],
    },
    { stepBy: (steps) => by.push(steps) },
    () => {},
  );
  for (const { run } of matching(offers, "hands")) run();
  assert.deepEqual(by, [505]);
});

test("one large picture and the others stand close together in a wide pane", () => {
  for (const count of [2, 3, 7]) {
    const { cells } = mosaic(Array(count).fill(1.25), 0, { width: 1280, most: 430, gap: 4 });
    const lefts = [...new Set(cells.map(({ x }) => x))].sort((a, b) => a - b);
    for (const [k, left] of lefts.slice(1).entries()) {
      const before = cells.find(({ x }) => x === lefts[k]);
      assert.ok(left - before.x - before.width <= 6, `${count} cameras: a void of ${left}`);
    }
    const last = cells.find(({ x }) => x === lefts.at(-1));
    assert.ok(Math.abs(lefts[0] - (1280 - last.x - last.width)) <= 3, "in the middle");
  }
});

test("cells are sorted as numbers or as words, and what is none stands last", () => {
  const sorted = (cells, number, down = false) =>
    [...cells].sort((a, b) => compareCells(a, b, number, down));
  const numbers = ["10 px", "–", "−0.5", "9"];
  assert.deepEqual(sorted(numbers, true), ["−0.5", "9", "10 px", "–"]);
  assert.deepEqual(sorted(numbers, true, true), ["10 px", "9", "−0.5", "–"]);
  assert.deepEqual(sorted(["cam10", "Cam2", "birth"], false), ["birth", "Cam2", "cam10"]);
});

test("the bar of one metre stands in a corner without a camera's name", () => {
  const label = (x, y) => ({ x, y, half: 0.4 });
  const corner = (...labels) => freeCorner(labels, 6, 5, 0.02).map((v) => Number(v.toFixed(2)));
  assert.deepEqual(corner(), [5.34, 4.8]);
  assert.deepEqual(corner(label(5.6, 4.9)), [0.66, 4.8]);
  assert.deepEqual(corner(label(5.6, 4.9), label(0.4, 4.9)), [5.34, 0.44]);
});
