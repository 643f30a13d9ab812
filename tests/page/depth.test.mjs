/** What viser's page is told before its client starts: which meshes write depth. */
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { test } from "node:test";

const [BLEND, FRONTS, BACKS] = [3042, 2305, 2304];
const gateway = readFileSync(new URL("../../app/web/access/gateway.py", import.meta.url), "utf8");
const [, script] = /BACKS_WRITE_NO_DEPTH = b"""<script>([\s\S]*?)<\/script>"""/.exec(gateway);

/** A context that writes down with which depth mask it drew. */
function context() {
  class WebGL2RenderingContext {
    mask = true;
    drawn = [];
    enable() {}
    disable() {}
    frontFace() {}
    depthMask(on) {
      this.mask = on;
    }
    drawElementsInstanced(...what) {
      this.drawn.push([this.mask, ...what]);
    }
  }
  Object.assign(WebGL2RenderingContext.prototype, { BLEND, CW: BACKS });
  new Function("WebGL2RenderingContext", script)(WebGL2RenderingContext);
  return new WebGL2RenderingContext();
}

test("backs that one sees through write no depth, all else as it was asked", () => {
  const gl = context();
  const masks = [];
  for (const blends of [true, false])
    for (const side of [BACKS, FRONTS])
      for (const mask of [true, false]) {
        gl[blends ? "enable" : "disable"](BLEND);
        gl.frontFace(side);
        gl.depthMask(mask);
        gl.drawElementsInstanced(4, 960, 5125, 0, 3);
        const [[drawn, ...what]] = gl.drawn.splice(0);
        assert.deepEqual(what, [4, 960, 5125, 0, 3]);
        assert.equal(gl.mask, mask); // afterwards as the client left it
        masks.push(drawn);
      }
  assert.deepEqual(masks, [false, false, true, false, true, false, true, false]);
});
