/** What a person asks for, against a server that answers as it is told to. */
import assert from "node:assert/strict";
import test from "node:test";

import { createActions } from "../../static/js/state/actions.js";
import { isOld } from "../../static/js/state/events.js";
import { createReceiver } from "../../static/js/state/receiving.js";
import { createStore } from "../../static/js/state/store.js";

/** @param {[number, object][]} answers  status and body, one for each request */
function page(answers) {
  const store = createStore({ notes: [], dismissed: [], server: null });
  globalThis.fetch = async () => {
    const [status, body] = answers.shift();
    return new Response(body && JSON.stringify(body), { status });
  };
  const none = () => true;
  return { store, actions: createActions({ store, seek: none, send: none, receive: none }) };
}

test("what was refused is said until the like is accepted", async () => {
  const refused = (detail) => [422, { detail, code: "no" }];
  const { store, actions } = page([
    refused("There is no such file."),
    refused("That is no network."),
    refused("Two rays pass each other."),
    [200, {}],
    [200, {}],
  ]);
  const said = () => store.get().notes.map(({ title }) => title);
  await actions.ask("PUT", "teach/detector", { model: "a" });
  await actions.ask("PUT", "teach/detector", { model: "b" });
  assert.deepEqual(said(), ["There is no such file.", "That is no network."]);
  await actions.ask("POST", "corrections", {});
  await actions.ask("PUT", "teach/detector", { model: "c" });
  assert.deepEqual(said(), ["Two rays pass each other."]);
  actions.note("warn", "Worth knowing", "");
  await actions.ask("POST", "corrections", {});
  assert.deepEqual(said(), ["Worth knowing"]);
});

test("a value that was refused is back at what it was, and its note goes by itself", async () => {
  const { store, actions } = page([
    [422, { detail: "Clutter rate: must be between 0 and 50, got 70", code: "bad_parameter" }],
    [422, { detail: "There is no such file.", code: "no_file" }],
  ]);
  await actions.change({ "fusion.clutter_rate": 70 });
  await actions.ask("POST", "sequence", { name: "nowhere" });
  const levels = store.get().notes.map(({ level }) => level);
  assert.deepEqual(levels, ["info", "error"], "notes of what was done go, errors stay");
});

test("a command is answered by nothing, or by what only who asked needs", async () => {
  const { store, actions } = page([
    [204, null],
    [200, { bytes: 4 }],
    [409, { detail: "No sequence is open.", code: "nothing_open" }],
  ]);
  assert.equal(await actions.command("add_entrance"), true);
  assert.deepEqual(await actions.command("delete_runs", { runs: [1] }), { bytes: 4 });
  assert.equal(await actions.command("add_entrance"), null);
  assert.deepEqual(
    store.get().notes.map(({ title }) => title),
    ["No sequence is open."],
  );
});

test("the same thing said again is one note, the newest, that counts", () => {
  const { store, actions } = page([]);
  actions.note("info", "No event after step 39", "");
  actions.note("info", "Copied", "");
  actions.note("info", "No event after step 39", "");
  const said = store.get().notes.map(({ title, times }) => [title, times]);
  assert.deepEqual(said, [
    ["Copied", 1],
    ["No event after step 39", 2],
  ]);
});

test("a note on an edit offers to undo that edit alone", async () => {
  const edits = { undo: "run 3 deleted", redo: null };
  const { store, actions } = page([
    [200, { version: 7, edits }],
    [200, { version: 8, edits: { undo: null, redo: null } }],
  ]);
  await actions.noteEdit("Run 3 deleted, 4 MB", "");
  await actions.noteEdit("Run 4 deleted, 4 MB", "");
  const offered = store.get().notes.map(({ remedy }) => remedy?.edit);
  assert.deepEqual(offered, ["run 3 deleted", undefined]);
});

test("only a recording that this window did not ask for was opened in another", async () => {
  for (const [ask, told] of [
    [(actions) => actions.openRun(3, "hall"), []],
    [(actions) => actions.open("/data/hall"), []],
    [() => {}, ["hall was opened in another window"]],
  ]) {
    const { store, actions } = page(Array.from({ length: 9 }, () => [200, {}]));
    const nothing = () => {};
    const receiver = createReceiver({
      store,
      actions,
      playback: { clear: nothing },
      address: { begin: nothing, arrive: nothing },
      isOld: () => false,
    });
    const state = (name) => ({
      version: 1,
      parameters: {},
      methods: {},
      layers: {},
      run: { key: name },
      sequence: { key: name, name, opened_as: `/data/${name}`, cameras: [] },
    });
    receiver.receiveState(state("room"), true);
    await ask(actions);
    receiver.receiveState(state("hall"), true);
    assert.deepEqual(
      store.get().notes.map(({ title }) => title),
      told,
    );
  }
});

/** A receiver of a recording with truth, whose requests are written down. */
function receiver() {
  const { store, actions } = page([]);
  const asked = [];
  globalThis.fetch = async (path) => {
    asked.push(path.split("?")[0]);
    return new Response(JSON.stringify({ run: path.includes("timeline") ? "second" : "" }));
  };
  const nothing = () => {};
  const made = createReceiver({
    store,
    actions,
    playback: { clear: nothing, receive: nothing },
    address: { begin: nothing, arrive: nothing },
    isOld: () => false,
  });
  const sequence = { key: "hall", name: "hall", opened_as: "hall", cameras: [], has_truth: true };
  const run = { key: "first", state: "computing", done: 40 };
  const state = { version: 1, parameters: {}, methods: {}, layers: {}, run, sequence };
  made.receiveState(state, true);
  return { store, made, asked };
}

test("figures are asked for once the server has some", async () => {
  const { made, asked } = receiver();
  made.refresh();
  await new Promise((resolve) => setTimeout(resolve, 10));
  assert.ok(asked.includes("/api/timeline"));
  assert.ok(!asked.includes("/api/evaluation/curves"));
  made.receive({ type: "evaluation", run: "first" });
  await new Promise((resolve) => setTimeout(resolve, 400));
  assert.ok(asked.includes("/api/evaluation/curves"));
});

test("lanes of the run before stay, and are old, until those of the new run are there", async () => {
  const { store, made } = receiver();
  store.set({ basis: "first", timeline: { run: "first" }, run: { key: "second" } });
  made.receive({ type: "timeline", run: "second", revision: 1 });
  assert.equal(store.get().timeline.run, "first");
  assert.ok(isOld(store.get(), store.get().timeline.run));
  await new Promise((resolve) => setTimeout(resolve, 10));
  assert.equal(store.get().timeline.run, "second");
  assert.ok(!isOld(store.get(), "second"));
  assert.ok(!isOld({ run: { key: "second", state: "failed" } }, "first"), "it is meant to be seen");
});
