// Casts rays through the volume of a page into a picture: all that is on the graphics card for it.

import { Bricks } from "./bricks.js";
import { VolumeLight, strengthsOf } from "./exposure.js";
import { SIZE, functionTables, integralsOf, materialOf, sourcesOf } from "./function_table.js";
import { labelsOf } from "./labels.js";
import { makeProgram, makeTexture } from "./program.js";
import { PRESENT_VERTEX } from "./shaders.js";
import { bind, setView } from "./surfel_pass.js";
import { PER_TEXTURE, volumeFragment } from "./volume_shaders.js";

const NARROWEST = 1e-6; // window, of all codes
const BLACK = [2, 3]; // a window in which no code is above black

export class VolumePass {
  #gl; #facts; #bricks; #samples; #textures; #light;
  #shaders = new Map(); // by sources
  #lit = { lamp: null, sky: null }; // cells that the textures hold
  #shown = ""; // what the table and the distances show

  /**
   * @param {WebGL2RenderingContext} gl
   * @param {object} samples codes of `channels` and their `sizes` x, y, z, see samples.js.
   * @param {object} facts channels with the ranges of their values, box and appearance: `volume` of the description
   *   of a scene.
   * @throws {Error} where the volume is too large for the card.
   */
  constructor(gl, { channels, sizes }, facts) {
    this.#gl = gl;
    this.#facts = facts;
    this.#bricks = new Bricks(channels, sizes);
    this.#light = new VolumeLight({ channels, sizes }, facts);
    const format = channels.length > 1 ? [gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE] : [gl.R8, gl.RED, gl.UNSIGNED_BYTE];
    this.#samples = Array.from({ length: Math.ceil(channels.length / PER_TEXTURE) }, (_, t) => {
      const codes = together(channels.slice(PER_TEXTURE * t, PER_TEXTURE * (t + 1)), channels.length > 1 ? PER_TEXTURE : 1);
      return makeTexture(gl, format, sizes, codes, { filter: gl.LINEAR, isSolid: true });
    });
    this.#textures = {
      ...Object.fromEntries(this.#samples.map((each, t) => [`samples${t}`, each])),
      bricks: makeTexture(gl, [gl.R8UI, gl.RED_INTEGER, gl.UNSIGNED_BYTE], this.#bricks.size, null, { isSolid: true }),
      table: makeTexture(gl, [gl.RGBA32F, gl.RGBA, gl.FLOAT], [1, 1], null),
      weights: makeTexture(gl, [gl.R8, gl.RED, gl.UNSIGNED_BYTE], [1, 1], new Uint8Array([255])),
      lamp: makeTexture(gl, [gl.R8, gl.RED, gl.UNSIGNED_BYTE], [1, 1, 1], null, { filter: gl.LINEAR, isSolid: true }),
      sky: makeTexture(gl, [gl.R8, gl.RED, gl.UNSIGNED_BYTE], [1, 1, 1], null, { filter: gl.LINEAR, isSolid: true }),
    };
    this.voxel = Math.min(...sizes.map((size, axis) => 2 * facts.half[axis] / (size - 1))); // world units
    this.unit = facts.appearance.opacity_unit;
  }

  /**
   * Casts.
   *
   * @param {Target} target that the picture is in: premultiplied colour and alpha, first row on top.
   * @param {object} view viewmat [12], focal and size [2].
   * @param {object} scene description with its edits.
   * @param {object} look `light`, a direction [3] or null for a headlight, and `planes` that cut.
   * @param {object} how `step`, in voxels; and to show only what is behind faces, its `reach` in world units, and
   *   what part of that each pixel shows, a texture of `weights`; by default all;
   *   `isOver`: over what is in the target; `isDepth`: depths in place of colours; `isMoving`: see `VolumeLight`.
   */
  cast(target, view, scene, look, { step, reach = 0, weights = this.#textures.weights, isOver = false, isDepth = false, isMoving = false }) {
    const gl = this.#gl, { program, uniforms } = this.#shadersOf(scene), viewer = view.viewmat.slice(8, 11).map((x) => -x);
    const { light, planes } = look;
    this.#show(scene);
    this.#shine(scene, look, isMoving);
    target.begin(view.size, isOver);
    gl.useProgram(program);
    gl.uniform2fv(uniforms.strengths, strengthsOf(scene, light));
    gl.uniform2f(uniforms.outsets, this.#lit.lamp.outset, this.#lit.sky.outset);
    Object.entries({ ...this.#textures, weights }).forEach(([name, each], unit) => bind(gl, unit, each, uniforms[name]));
    setView(gl, uniforms, view);
    gl.uniform3fv(uniforms.box, this.#facts.half);
    gl.uniform1f(uniforms.interval, step * this.voxel);
    gl.uniform1f(uniforms.unit, this.unit);
    gl.uniform1f(uniforms.reach, reach);
    gl.uniform1i(uniforms.is_depth, isDepth ? 1 : 0);
    gl.uniform3fv(uniforms.viewer, viewer);
    gl.uniform3fv(uniforms.light, light ?? viewer);
    const { factors, tint } = materialOf(scene, this.#facts.appearance);
    gl.uniform4fv(uniforms.material, factors);
    gl.uniform3fv(uniforms.tint, tint);
    gl.uniform1i(uniforms.are_faces_lit, scene.cuts.faces === "shaded" ? 1 : 0);
    this.#showSlice(uniforms, scene);
    gl.uniform1i(uniforms.n_planes, planes.length);
    if (planes.length) gl.uniform4fv(uniforms["planes[0]"], planes.flatMap(unitPlane));
    if (isOver) gl.enable(gl.BLEND);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    gl.disable(gl.BLEND);
    target.end();
  }

  #showSlice(uniforms, scene) {
    const gl = this.#gl, { channels } = this.#facts, { low, high } = channels[0], isSlice = scene.cuts.faces === "slice";
    gl.uniform1i(uniforms.is_slice, isSlice ? 1 : 0);
    if (!isSlice) return;
    const window = scene.cuts.window ?? scene.slices.window, covers = new Float32Array(4 * channels.length);
    const labels = labelsOf(scene, channels), hasImage = !labels.some(({ channel }) => channel === 0);
    const [black, white] = window.map((value) => (value - low) / (high - low));
    gl.uniform2fv(uniforms.window, hasImage ? [black, Math.max(white, black + NARROWEST)] : BLACK);
    for (const { channel, color, cover } of labels) if (color) covers.set([...color, cover], 4 * channel);
    gl.uniform4fv(uniforms["labels[0]"], covers);
  }

  #shadersOf(scene) {
    const sources = sourcesOf(scene, this.#facts.channels), key = sources.map((each) => each.key).join();
    if (!this.#shaders.has(key)) {
      this.#shaders.set(key, makeProgram(this.#gl, PRESENT_VERTEX, volumeFragment(sources, this.#facts.channels)));
    }
    return this.#shaders.get(key);
  }

  /** What of a scene's light reaches cells, see `VolumeLight`. */
  cells(scene, look, isMoving) {
    return this.#light.cells(scene, look, isMoving);
  }

  /** Take what of a scene's light reaches cells, where that is something else than before. */
  #shine(scene, look, isMoving) {
    const gl = this.#gl, cells = this.cells(scene, look, isMoving);
    for (const name of ["lamp", "sky"]) {
      if (cells[name] === this.#lit[name]) continue;
      gl.bindTexture(gl.TEXTURE_3D, this.#textures[name].texture);
      gl.texImage3D(gl.TEXTURE_3D, 0, gl.R8, ...cells[name].size, 0, gl.RED, gl.UNSIGNED_BYTE, cells[name].values);
    }
    this.#lit = cells;
  }

  /** Take what a scene shows, where that is something else than before. */
  #show(scene) {
    const gl = this.#gl, { models, functions } = scene, shown = JSON.stringify([models.map(({ edit }) => edit), functions]);
    if (shown === this.#shown) return;
    this.#shown = shown;
    const tables = functionTables(scene, this.#facts.channels), rows = tables.flatMap(({ table }) => [table, integralsOf(table)]);
    gl.bindTexture(gl.TEXTURE_2D, this.#textures.table.texture);
    gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, SIZE, rows.length, 0, gl.RGBA, gl.FLOAT, null);
    rows.forEach((row, y) => gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, y, SIZE, 1, gl.RGBA, gl.FLOAT, row));
    gl.bindTexture(gl.TEXTURE_3D, this.#textures.bricks.texture);
    gl.texSubImage3D(gl.TEXTURE_3D, 0, 0, 0, 0, ...this.#bricks.size, gl.RED_INTEGER, gl.UNSIGNED_BYTE,
      this.#bricks.distances(tables));
  }
}

/** Codes of channels side by side, so many to a texel. */
function together(channels, width) {
  if (width === 1) return channels[0];
  const codes = new Uint8Array(width * channels[0].length);
  channels.forEach((own, c) => {
    for (let i = 0; i < own.length; i++) codes[width * i + c] = own[i];
  });
  return codes;
}

/** A plane with a normal of length 1. */
function unitPlane({ normal, offset }) {
  const length = Math.hypot(...normal);
  return [...normal, offset].map((x) => x / length);
}
