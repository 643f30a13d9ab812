// What the page loads: nothing from elsewhere, all modules at once, not too much of it.
import assert from "node:assert/strict";
import { readdirSync, readFileSync, statSync } from "node:fs";
import { join, relative } from "node:path";
import { test } from "node:test";
import { fileURLToPath } from "node:url";
import { PLACES } from "../../static/js/state/address.js";

const ROOT = fileURLToPath(new URL("../../static/", import.meta.url));
const files = readdirSync(ROOT, { recursive: true })
  .map(String)
  .filter((name) => statSync(join(ROOT, name)).isFile());
const scripts = files.filter((name) => name.endsWith(".js"));

/** A module and all that it imports, however far; `later`: what is read when the page is there too. */
function reached(name, later, known = new Set()) {
  known.add(name);
  const text = readFileSync(join(ROOT, name), "utf8");
  const ways = [/from "([^"]+)"/g, ...(later ? [/(?:void|\?\?=|=>)\s+import\("([^"]+)"\)/g] : [])];
  for (const [, target] of ways.flatMap((way) => [...text.matchAll(way)])) {
    const other = relative(ROOT, join(ROOT, name, "..", target)).replaceAll("\\", "/");
    if (!known.has(other)) reached(other, later, known);
  }
  return known;
}
const atFirst = [...reached("js/theme.js", false), ...reached("js/main.js", false)].sort();

test("every module that the page begins with is loaded at once, and none that is not there", () => {
  const html = readFileSync(join(ROOT, "index.html"), "utf8");
  const named = [...html.matchAll(/(?:href|src)="\/static\/([^"]+\.js)"/g)].map(
    (match) => match[1],
  );
  assert.deepEqual([...named].sort(), atFirst);
});

test("every module is read at some time", () => {
  const all = new Set([...reached("js/theme.js", true), ...reached("js/main.js", true)]);
  assert.deepEqual([...all].sort(), scripts.map((name) => name.replaceAll("\\", "/")).sort());
});

test("every import is a file of the page", () => {
  for (const name of scripts) {
    const text = readFileSync(join(ROOT, name), "utf8");
    for (const [, target] of text.matchAll(/from "([^"]+)"/g)) {
      assert.match(target, /^\.{1,2}\//, `${name} imports ${target}`);
      assert.ok(
        scripts.includes(relative(ROOT, join(ROOT, name, "..", target))),
        `${name} imports ${target}`,
      );
    }
  }
});

test("nothing comes from another host", () => {
  for (const name of files.filter((file) => /\.(html|css|js)$/.test(file))) {
    const text = readFileSync(join(ROOT, name), "utf8").replaceAll(
      "http://www.w3.org/2000/svg",
      "",
    );
    assert.doesNotMatch(text, /https?:\/\//, name);
  }
});

test("the page stays light: it begins with at most 220 kB of JavaScript", () => {
  const bytes = atFirst.reduce((sum, name) => sum + statSync(join(ROOT, name)).size, 0);
  assert.ok(bytes <= 220_000, `${bytes} bytes`);
});

test("every part that a module asks for is in the page", () => {
  const html = readFileSync(join(ROOT, "index.html"), "utf8");
  for (const name of scripts) {
    const text = readFileSync(join(ROOT, name), "utf8");
    for (const [, list] of text.matchAll(/const \{([^}]+)\} = parts\(/g)) {
      for (const part of list.split(",").filter((name) => name.trim()))
        assert.ok(
          html.includes(`data-ref="${part.split(":")[0].trim()}"`),
          `${name} asks for ${part}`,
        );
    }
  }
});

test("every symbol that is used is in the page", () => {
  const html = readFileSync(join(ROOT, "index.html"), "utf8");
  const known = new Set([...html.matchAll(/symbol id="([^"]+)"/g)].map((match) => match[1]));
  for (const name of scripts) {
    const text = readFileSync(join(ROOT, name), "utf8");
    for (const [, symbol] of text.matchAll(/"#?((?:i|l)-[a-z]+)"/g))
      assert.ok(known.has(symbol), `${name} uses ${symbol}`);
  }
  for (const [, symbol] of html.matchAll(/<use href="#([^"]+)"/g))
    assert.ok(known.has(symbol), symbol);
});

test("the places stand in the page before a module is read", () => {
  const html = readFileSync(join(ROOT, "index.html"), "utf8");
  const found = [...html.matchAll(/class="place" href="#([^"]+)"\s*>([^<]+)</g)];
  assert.deepEqual(
    found.map(([, name, word]) => [name, word]),
    PLACES.map(({ name, word }) => [name, word]),
  );
});
