// Addresses that people have kept, as tests/compatibility has them: each means what it meant.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";
import { readPlace, writePlace } from "../../static/js/state/address.js";
import { viewFrom, viewOf } from "../../static/js/state/address.js";

const kept = JSON.parse(
  readFileSync(new URL("../compatibility/addresses.json", import.meta.url), "utf8"),
);

/** Values as an address has them. */
const texts = (values) =>
  values && Object.fromEntries(Object.entries(values).map(([key, value]) => [key, String(value)]));

for (const { address, note, view = {}, stays = view, unknown = [], ...named } of kept)
  test(`an address that was kept: ${note}`, () => {
    const { sequence = null, step = null, selection = null, camera = null, look = null } = named;
    const { values = null, pinned = null } = named;
    const place = { sequence, step, selection, camera, look, view };
    const read = readPlace(address);
    assert.deepEqual(read, {
      place: { ...place, values: texts(values), pinned: texts(pinned) },
      unknown,
    });
    assert.deepEqual(readPlace(writePlace(read.place)).place, read.place);
    // what is not as at first is what the address named, as far as that means anything
    assert.deepEqual(viewOf({ ...viewFrom(view), frames: 120 }), stays);
  });
