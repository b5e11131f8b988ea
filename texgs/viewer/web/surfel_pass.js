// Blends surfels in a given order into a picture of floats: all that is on the graphics card for it.

import { dot } from "./camera.js";
import { COLUMNS } from "./parts.js";
import { makeProgram, makeTexture } from "./program.js";
import { SURFEL_FRAGMENT, SURFEL_VERTEX } from "./shaders.js";
import { LAYERS, PLACED, WIDTH } from "./surfels.js";
import { Target } from "./target.js";

const BEYOND = 1e9; // a depth that nothing has

export const NEAR = 0.01; // camera z, world units, as the rasterizer has it

export class SurfelPass {
  /**
   * @param {WebGL2RenderingContext} gl
   * @param {object} joined surfels, see surfels.js.
   * @param {object} optics `low_pass` of the models, and `step` of their texels.
   * @param {number} rows of the table of parts.
   * @throws {Error} where textures of the scene are too large for the card, or no floats can be blended.
   */
  constructor(gl, { count, surfels, lookups, texels }, optics, rows) {
    if (!gl.getExtension("EXT_color_buffer_float")) {
      throw new Error("The graphics driver draws no floating-point pictures, which this scene needs: update it.");
    }
    // Half precision stops adding up faint fragments; where floats cannot be blended it is what there is.
    const [format, type] = gl.getExtension("EXT_float_blend") ? [gl.RGBA32F, gl.FLOAT] : [gl.RGBA16F, gl.HALF_FLOAT];
    this.target = new Target(gl, [format, gl.RGBA, type]);
    this._gl = gl;
    this._optics = optics;
    this._shaders = makeProgram(gl, SURFEL_VERTEX, SURFEL_FRAGMENT);
    const height = lookups.length / (4 * WIDTH);
    const isSmall = texels instanceof Int8Array;
    const ofTexels = [isSmall ? gl.RGB8I : gl.RGB16I, gl.RGB_INTEGER, isSmall ? gl.BYTE : gl.SHORT];
    const floats = [gl.RGBA32F, gl.RGBA, gl.FLOAT];
    this._textures = {
      surfels: makeTexture(gl, floats, [WIDTH, height, LAYERS.length], surfels),
      lookups: makeTexture(gl, [gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT], [WIDTH, height], lookups),
      texels: makeTexture(gl, ofTexels, [WIDTH, texels.length / (3 * WIDTH)], texels),
      order: makeTexture(gl, [gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT], [WIDTH, height], null),
      parts: makeTexture(gl, floats, [COLUMNS, rows], null),
      shares: makeTexture(gl, [gl.RG8, gl.RG, gl.UNSIGNED_BYTE], [WIDTH, height], null),
    };
    this._makeCorners(count);
  }

  /**
   * Blends far to near.
   *
   * @param {object} view viewmat [12], focal and size [2].
   * @param {object} look `mode` (a number), `light`, a direction [3] or null for a headlight, `planes` that cut, and
   *   `exposure` of the surfels, see `SurfelLight`.
   * @param {Float32Array} table of parts.
   * @param {Uint32Array} order of the surfels, in a buffer of whole rows of the texture.
   * @param {object|null} slab that hides them behind faces: its `reach` in world units, and a texture of `weights`.
   * @returns {object} the picture, a texture whose first row is on top: premultiplied colour and alpha.
   */
  blend(view, { mode, light, planes, exposure }, table, order, slab = null) {
    const gl = this._gl;
    const { program, uniforms } = this._shaders;
    this.target.begin(view.size);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.useProgram(program);
    this._upload(table, order);
    this._expose(exposure.shares);
    const textures = { ...this._textures, weights: slab?.weights ?? this._textures.parts };
    Object.entries(textures).forEach(([name, texture], unit) => bind(gl, unit, texture, uniforms[name]));
    setView(gl, uniforms, view);
    setPlanes(gl, uniforms, view, planes);
    gl.uniform1i(uniforms.headlight, light ? 0 : 1);
    gl.uniform3fv(uniforms.light, light ?? [0, 0, 1]);
    gl.uniform1i(uniforms.look, mode);
    gl.uniform2fv(uniforms.strengths, exposure.strengths);
    gl.uniform1f(uniforms.reach, slab?.reach ?? 0);
    gl.uniform1f(uniforms.low_pass, this._optics.low_pass);
    gl.uniform1f(uniforms.near, NEAR);
    gl.uniform1f(uniforms.texel_step, this._optics.step);
    gl.bindVertexArray(this._vertices);
    gl.drawElements(gl.TRIANGLES, 6 * order.length, gl.UNSIGNED_INT, 0);
    gl.bindVertexArray(null);
    gl.disable(gl.BLEND);
    this.target.end();
    return this.target.picture;
  }

  /** Takes other places of the same surfels: the layers of `PLACED`. */
  place(surfels) {
    const gl = this._gl, { texture, target } = this._textures.surfels, height = surfels.length / (4 * WIDTH * LAYERS.length);
    gl.bindTexture(target, texture);
    gl.texSubImage3D(target, 0, 0, 0, 0, WIDTH, height, PLACED.length, gl.RGBA, gl.FLOAT, surfels);
  }

  /** The least and the largest mean depth of pixels that are not faint, where depth was blended; BEYOND if none is. */
  depths() {
    const gl = this._gl, [width, height] = this.target.size;
    const pixels = new Float32Array(4 * width * height);
    this.target.bind();
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.FLOAT, pixels);
    this.target.end();
    let low = Infinity, high = 0, densest = 0;
    for (let i = 3; i < pixels.length; i += 4) densest = Math.max(densest, pixels[i]);
    const solid = Math.min(0.5, 0.5 * densest); // as relative_depth of texgs/scene/frame.py
    for (let i = 0; i < pixels.length; i += 4) {
      const alpha = pixels[i + 3], depth = pixels[i] / alpha;
      if (alpha > solid) [low, high] = [Math.min(low, depth), Math.max(high, depth)];
    }
    return high ? [low, high] : [BEYOND, BEYOND];
  }

  _upload(table, order) {
    const gl = this._gl, rows = Math.ceil(order.length / WIDTH), parts = table.length / (4 * COLUMNS);
    const whole = new Uint32Array(order.buffer, order.byteOffset, rows * WIDTH);
    gl.bindTexture(gl.TEXTURE_2D, this._textures.parts.texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, COLUMNS, parts, gl.RGBA, gl.FLOAT, table);
    gl.bindTexture(gl.TEXTURE_2D, this._textures.order.texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WIDTH, rows, gl.RED_INTEGER, gl.UNSIGNED_INT, whole);
  }

  /** Takes shares of light, where they are others than before. */
  _expose(shares) {
    const gl = this._gl;
    if (!shares || shares === this._shares) return;
    this._shares = shares;
    gl.bindTexture(gl.TEXTURE_2D, this._textures.shares.texture);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, WIDTH, shares.length / (2 * WIDTH), gl.RG, gl.UNSIGNED_BYTE, shares);
  }

  /** Two triangles for each surfel. Instances would be fewer numbers, but software draws them one by one. */
  _makeCorners(count) {
    const gl = this._gl, corners = new Uint32Array(6 * count);
    for (let i = 0; i < count; i++) [0, 1, 2, 2, 1, 3].forEach((corner, k) => { corners[6 * i + k] = 4 * i + corner; });
    this._vertices = gl.createVertexArray();
    gl.bindVertexArray(this._vertices);
    gl.bindBuffer(gl.ELEMENT_ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ELEMENT_ARRAY_BUFFER, corners, gl.STATIC_DRAW);
    gl.bindVertexArray(null);
  }
}

/** Lets a sampler read a texture. */
export function bind(gl, unit, { texture, target }, uniform) {
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(target, texture);
  gl.uniform1i(uniform, unit);
}

/** Planes keep normal . x <= offset in the world; the camera has p = R x + t. */
function setPlanes(gl, uniforms, { viewmat }, planes) {
  const rows = [viewmat.slice(0, 4), viewmat.slice(4, 8), viewmat.slice(8, 12)];
  const inCamera = planes.flatMap(({ normal, offset }) => {
    const turned = rows.map((row) => dot(row, normal));
    return [...turned, offset + dot(turned, rows.map((row) => row[3]))];
  });
  gl.uniform1i(uniforms.n_planes, planes.length);
  if (planes.length) gl.uniform4fv(uniforms["planes[0]"], inCamera);
}

/** Sets the camera. */
export function setView(gl, uniforms, { viewmat, focal, size }) {
  const [a, b, c, x, d, e, f, y, g, h, i, z] = viewmat;
  gl.uniformMatrix3fv(uniforms.rotation, true, [a, b, c, d, e, f, g, h, i]);
  gl.uniform3f(uniforms.translation, x, y, z);
  gl.uniform2fv(uniforms.focal, focal);
  gl.uniform2fv(uniforms.size, size);
}
