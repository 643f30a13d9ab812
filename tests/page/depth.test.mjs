/** What viser's page is told before its client starts: which meshes write depth, how labels look. */
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

const [, labels] = /LABELS_WEAR_THE_THEME = b"""<script>([\s\S]*?)<\/script>"""/.exec(gateway);

test("labels are drawn in the ink and on the ground of the theme, all else as it was asked", () => {
  const page = { documentElement: { dataset: {} } };
  class WebGL2RenderingContext {
    set = {};
    shaderSource(shader, text) {
      shader.text = text;
    }
    useProgram() {}
    getUniformLocation({ text }, name) {
      return text.includes(`uniform vec3 ${name};`) ? name : null;
    }
    uniform3fv(place, colour) {
      this.set[place] = colour;
    }
  }
  const themes = {
    dark: { ink: [0.9, 0.9, 0.9], ground: [0.1, 0.1, 0.1] },
    light: { ink: [0, 0, 0], ground: [1, 1, 1] },
  };
  new Function("WebGL2RenderingContext", "document", labels.replace("{}", JSON.stringify(themes)))(
    WebGL2RenderingContext,
    page,
  );
  const gl = new WebGL2RenderingContext();
  const shader = (colour, varies = "varying float vAlpha;") => {
    const made = {};
    gl.shaderSource(made, `${varies}\nvoid main() {\n  gl_FragColor = ${colour};\n}`);
    return made;
  };
  const letter = shader("vec4(0.0, 0.0, 0.0, a)");
  const plate = shader("vec4(1.0, 1.0, 1.0, 0.85 * vAlpha)");
  assert.ok(letter.text.includes("gl_FragColor = vec4(ink, a);"));
  assert.ok(plate.text.includes("gl_FragColor = vec4(ground, 0.85 * vAlpha);"));
  assert.ok(!shader("vec4(0.0, 0.0, 0.0, a)", "").text.includes("ink"));
  for (const theme of ["dark", "light"]) {
    page.documentElement.dataset.mantineColorScheme = theme;
    for (const program of [letter, plate, null]) gl.useProgram(program);
    assert.deepEqual(gl.set, themes[theme]);
  }
});
