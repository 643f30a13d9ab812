// One registry of commands: no two share a key, each has words, keys are named alike everywhere.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { TABS } from "../../static/js/state/address.js";
import {
  COMMANDS,
  commandFor,
  commandOf,
  keyLabel,
  keyOf,
  perform,
  register,
  search,
} from "../../static/js/state/commands.js";

const read = (name) => readFileSync(new URL(`../../static/${name}`, import.meta.url), "utf8");
register(JSON.parse(read("commands.json")));

const event = (key, modifiers = {}) => ({
  key,
  ctrlKey: false,
  metaKey: false,
  altKey: false,
  shiftKey: false,
  ...modifiers,
});

/** Keys that more than one command claims. */
function clashes(commands) {
  const all = commands.flatMap((command) => command.keys);
  return all.filter((key, index) => all.indexOf(key) !== index);
}

test("no key belongs to two commands and no name to two", () => {
  // those of Check hold there alone, and there before the others
  for (const own of [true, false])
    assert.deepEqual(clashes(COMMANDS.filter(({ group }) => (group === "Check") === own)), []);
  assert.equal(new Set(COMMANDS.map((c) => c.name)).size, COMMANDS.length);
  assert.deepEqual(clashes([COMMANDS[0], COMMANDS[0]]), ["Space"]);
});

test("every command has a title and runs one action that there is", () => {
  const actions = read("js/state/actions.js");
  for (const command of COMMANDS) {
    assert.ok(command.title.length > 2, command.name);
    assert.match(actions, new RegExp(`^\\t\\t(async )?${command.action}[(:]`, "m"), command.name);
    const called = [];
    perform(command, { [command.action]: (...values) => called.push(values) });
    // a command without a value gives none: "Reset all" names no key and means all of them
    assert.deepEqual(called, ["value" in command ? [command.value] : []], command.name);
  }
});

test("every button of the page names a command that there is", () => {
  const html = read("index.html");
  const named = new Set(
    [...html.matchAll(/data-command(?:-key)?="([^"]+)"/g)].map((match) => match[1]),
  );
  for (const name of named) assert.ok(commandOf(name));
  assert.ok(named.has("play") && named.has("help"));
});

test("every tab of the side panel has a button and a panel, and a command that shows it", () => {
  const html = read("index.html");
  const names = (pattern) => [...html.matchAll(pattern)].map((match) => match[1]).sort();
  const tabs = [...TABS].sort();
  assert.deepEqual(names(/\bid="tab-(\w+)"/g), tabs);
  assert.deepEqual(names(/\bid="panel-(\w+)"/g), tabs);
  const shown = COMMANDS.filter(({ action }) => action === "showTab").map(({ value }) => value);
  // that of Check is there with its place alone
  assert.deepEqual([...shown, "place"].sort(), tabs);
});

test("the palette finds commands by their words, those that begin with them first", () => {
  assert.equal(search("undo")[0].name, "undo");
  assert.equal(search("step  ONE").length, 2);
  assert.equal(search("tim large")[0].name, "maximise-time");
  assert.equal(search("came in here")[0].name, "check-came");
  assert.equal(search("camera 1")[0].title.toLowerCase().includes("camera 1"), true);
  assert.equal(
    search("correct").some(({ name }) => name === "check-split"),
    true,
  );
  assert.deepEqual(search("no such thing"), []);
  assert.equal(search("").length, COMMANDS.length);
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
  assert.equal(find("s", { ctrlKey: true }), "save-taught");
  assert.equal(find("z", { metaKey: true }), "undo");
  assert.equal(find("ArrowLeft", { altKey: true }), undefined);
  assert.equal(find("y", { ctrlKey: true }), undefined);
});

test("a key of Check means what it says there, and what it meant before elsewhere; tracks are put right anywhere", () => {
  const find = (key, place) => commandFor(key, true, place)?.name;
  assert.equal(find("y", "check"), "check-next");
  assert.equal(find("y", "tune"), "hindsight");
  assert.equal(find("Ctrl+z", "check"), "undo");
  assert.equal(find("Ctrl+z", "tune"), "undo");
  assert.equal(find("Delete", "tune"), "check-nobody");
  assert.equal(find("Shift+F10", "tune"), "check-menu");
  assert.equal(find("Enter", "tune"), undefined);
  assert.equal(find("Space", "check"), "play");
});

test("single-key shortcuts can be switched off, arrows and help stay", () => {
  assert.equal(commandFor("g", false), undefined);
  assert.equal(commandFor("Shift+v", false), undefined);
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
