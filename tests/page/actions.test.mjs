/** What a person asks for, against a server that answers as it is told to. */
import assert from "node:assert/strict";
import test from "node:test";

import { createActions } from "../../static/js/state/actions.js";
import { createStore } from "../../static/js/state/store.js";

/** @param {[number, object][]} answers  status and body, one for each request */
function page(answers) {
  const store = createStore({ notes: [], dismissed: [] });
  globalThis.fetch = async () => {
    const [status, body] = answers.shift();
    return new Response(JSON.stringify(body), { status });
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
