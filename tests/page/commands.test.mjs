// One registry of commands: no two share a key, each has words, keys are named alike everywhere.
import assert from "node:assert/strict";
import { test } from "node:test";
import { clashes, COMMANDS, commandFor, commandOf, keyLabel, keyOf } from "../../static/js/commands.js";

const event = (key, modifiers = {}) => ({ key, ctrlKey: false, metaKey: false, altKey: false, shiftKey: false, ...modifiers });

test("no key belongs to two commands and no name to two", () => {
  assert.deepEqual(clashes(COMMANDS), []);
  assert.equal(new Set(COMMANDS.map((c) => c.name)).size, COMMANDS.length);
  assert.deepEqual(clashes([COMMANDS[0], COMMANDS[0]]), ["Space"]);
});

test("every command has a title, a key, and runs one action", () => {
  for (const command of COMMANDS) {
    assert.ok(command.title.length > 2, command.name);
    assert.ok(command.keys.length > 0, command.name);
    const called = [];
    const actions = new Proxy({}, { get: (_, name) => () => called.push(name) });
    command.run(actions);
    assert.equal(called.length, 1, command.name);
  }
});

test("a key event finds its command", () => {
  const find = (...parts) => commandFor(keyOf(event(...parts)))?.name;
  assert.equal(find(" "), "play");
  assert.equal(find("ArrowLeft"), "step-back");
  assert.equal(find("ArrowLeft", { shiftKey: true }), "second-back");
  assert.equal(find("n"), "next-event");
  assert.equal(find("N", { shiftKey: true }), "previous-event");
  assert.equal(find("?", { shiftKey: true }), "help");
  assert.equal(find("3"), "camera-3");
  assert.equal(find("z", { ctrlKey: true }), "undo");
  assert.equal(find("z", { metaKey: true }), "undo");
  assert.equal(find("ArrowLeft", { altKey: true }), undefined);
  assert.equal(find("s", { ctrlKey: true }), undefined);
});

test("single-key shortcuts can be switched off, arrows and help stay", () => {
  assert.equal(commandFor("g", false), undefined);
  assert.equal(commandFor("ArrowLeft", false)?.name, "step-back");
  assert.equal(commandFor("Ctrl+z", false)?.name, "undo");
  assert.equal(commandFor("?", false)?.name, "help");
});

test("keys have labels that people read", () => {
  assert.equal(keyLabel("Shift+ArrowLeft"), "Shift ←");
  assert.equal(keyLabel("Ctrl+z"), "Ctrl Z");
  assert.equal(keyLabel("Space"), "Space");
});

test("an unknown command says so", () => {
  assert.throws(() => commandOf("fly"), /no command fly/);
});
