// Draws a scene of surfels by WebGL2: sorted in every frame, blended far to near into floats, then shown.

import { firstRows, partTable, COLUMNS } from "./parts.js";
import { makeProgram, makeTexture } from "./program.js";
import { PRESENT_FRAGMENT, PRESENT_VERTEX, SURFEL_FRAGMENT, SURFEL_VERTEX } from "./shaders.js";
import { DepthOrder } from "./sort.js";
import { joinSurfels, LAYERS, WIDTH } from "./surfels.js";
import { unpack } from "./tensors.js";

// Those of texgs/scene/frame.py but for depth.
const MODES = ["shaded", "unshaded", "normal", "alpha", "ambient", "diffuse", "specular", "shininess"];
const OVER_BLACK = MODES.slice(3);
const NEAR = 0.2; // camera z, world units, as the rasterizer has it
const MOST_PIXELS = 4096; // of a side, as `texgs view` has it
const SLOW = 40; // milliseconds from frame to frame above which moving frames have half the resolution
const MISSING = "This browser has no WebGL2, which the picture needs: switch on hardware acceleration, or use another browser.";

export class WebglRenderer {
  /**
   * @param {HTMLCanvasElement} canvas to draw on; its size follows that on the page.
   * @param {function(string)} notice tells the user what went wrong, "" that it is over.
   * @throws {Error} where there is no WebGL2.
   */
  constructor(canvas, notice) {
    this.modes = MODES;
    this._canvas = canvas;
    this._notice = notice;
    const gl = canvas.getContext("webgl2", { alpha: false, antialias: false, depth: false, powerPreference: "high-performance" });
    if (!gl) throw new Error(MISSING);
    this._gl = gl;
    this._listeners = new AbortController();
    const listen = { signal: this._listeners.signal };
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault(); // asks for another context
      notice("The graphics driver has taken the picture back; it comes again by itself.");
    }, listen);
    canvas.addEventListener("webglcontextrestored", () => {
      this._upload();
      notice("");
      this._ask();
    }, listen);
  }

  /**
   * Takes the surfels of a scene.
   *
   * @param {string} packed their tensors, see tensors.js.
   * @param {object} scene its description; models and segments may not change later, their edits may.
   */
  async open(packed, scene) {
    const { tensors, metadata } = await unpack(packed);
    this._original = scene;
    this._optics = JSON.parse(metadata.optics);
    this._surfels = joinSurfels(tensors, this._optics.models, firstRows(scene.models));
    this._order = new DepthOrder(this._surfels.count);
    this._upload();
  }

  /** Size of the picture in pixels of the screen. */
  size() {
    const { clientWidth, clientHeight } = this._canvas;
    const ratio = Math.min(devicePixelRatio, MOST_PIXELS / Math.max(clientWidth, clientHeight, 1));
    return [clientWidth, clientHeight].map((side) => Math.max(1, Math.round(ratio * side)));
  }

  /**
   * Asks for a frame; of several, the newest wins.
   *
   * @param {OrbitCamera} camera
   * @param {object} scene description with its edits, light and background.
   * @param {object} how `mode`; whether to show the scene as it was `before`; whether something is `moving`: then
   *   slow frames are coarser.
   */
  draw(camera, scene, { mode = "shaded", moving = false, before = false } = {}) {
    this._wanted = { view: this._view(camera), scene: before ? this._original : scene, mode, moving };
    this._ask();
  }

  /** The same picture as a canvas of its own. */
  still(camera, scene, { mode, before }) {
    const view = this._view(camera);
    const { width, height } = view;
    const pixels = this.pixels(view, before ? this._original : scene, mode);
    const canvas = Object.assign(document.createElement("canvas"), { width, height });
    canvas.getContext("2d").putImageData(new ImageData(pixels, width, height), 0, 0);
    return canvas;
  }

  /**
   * Draws now.
   *
   * @param {object} view viewmat [3, 4] world to camera (OpenCV axes), fov_y in degrees, width and height in pixels.
   * @returns {Uint8ClampedArray} the picture [H, W, 4], first row on top.
   */
  pixels(view, scene, mode = "shaded") {
    this._frame(view, scene, mode);
    const gl = this._gl;
    const { width, height } = view;
    const upside = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, upside);
    const picture = new Uint8ClampedArray(upside.length);
    for (let y = 0; y < height; y++) {
      picture.set(upside.subarray(4 * width * (height - 1 - y), 4 * width * (height - y)), 4 * width * y);
    }
    return picture;
  }

  /** Gives the graphics memory back. */
  dispose() {
    this._listeners.abort();
    cancelAnimationFrame(this._request);
    this._gl.getExtension("WEBGL_lose_context")?.loseContext();
  }

  // ---- Frames ----

  _view(camera) {
    const [width, height] = this.size();
    return { viewmat: camera.viewmat(), fov_y: camera.fov_y, width, height };
  }

  _ask() {
    if (this._request || !this._wanted || this._gl.isContextLost()) return;
    this._request = requestAnimationFrame((time) => {
      this._request = 0;
      const { view, scene, mode, moving } = this._wanted;
      this._pace(time, moving);
      const share = moving && this._isSlow ? 0.5 : 1;
      const [width, height] = [view.width, view.height].map((side) => Math.ceil(share * side));
      this._frame({ ...view, width, height }, scene, mode);
    });
  }

  /** Notes whether frames of a moving camera come slowly. It stays noted until the camera rests. */
  _pace(time, moving) {
    const elapsed = time - (this._last ?? time);
    this._isSlow = moving && (this._isSlow || (elapsed > SLOW && elapsed < 1000));
    this._last = moving ? time : undefined;
  }

  _frame(camera, scene, mode) {
    const gl = this._gl;
    const { width, height } = camera;
    if (this._canvas.width !== width) this._canvas.width = width;
    if (this._canvas.height !== height) this._canvas.height = height;
    this._resize(width, height);
    const view = viewOf(camera);
    const table = partTable(scene.models, this._optics.models);
    const order = this._sort(view, table);
    gl.viewport(0, 0, width, height);
    this._blend(view, scene, mode, table, order);
    gl.bindFramebuffer(gl.FRAMEBUFFER, null);
    gl.disable(gl.BLEND);
    gl.useProgram(this._present.program);
    bind(gl, 0, this._picture, this._present.uniforms.picture);
    gl.uniform3fv(this._present.uniforms.background, OVER_BLACK.includes(mode) ? [0, 0, 0] : scene.background);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** Surfels beyond the near plane whose part is visible, far to near, by depths rounded as the rasterizer's. */
  _sort({ viewmat }, table) {
    const { count, surfels, lookups } = this._surfels;
    const [x, y, z, t] = viewmat.slice(8);
    const order = this._order;
    const round = Math.fround;
    order.clear();
    for (let i = 0, k = 0; i < count; i++, k += 4) {
      const sum = round(y * surfels[k + 1] + round(z * surfels[k + 2]));
      const depth = round(round(x * surfels[k] + sum) + t);
      if (depth > NEAR && table[4 * COLUMNS * lookups[k + 3] + 3] > 0) order.add(i, depth);
    }
    return order.farToNear();
  }

  /** Blends the surfels in this order into the target. */
  _blend(view, scene, mode, table, order) {
    const gl = this._gl;
    const { program, uniforms } = this._draw;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this._target);
    gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
    gl.enable(gl.BLEND);
    gl.blendFunc(gl.ONE, gl.ONE_MINUS_SRC_ALPHA);
    gl.useProgram(program);
    bind(gl, 0, this._textures.surfels, uniforms.surfels);
    bind(gl, 1, this._textures.lookups, uniforms.lookups);
    bind(gl, 2, this._textures.texels, uniforms.texels);
    bind(gl, 3, this._textures.parts, uniforms.parts);
    gl.texSubImage2D(gl.TEXTURE_2D, 0, 0, 0, COLUMNS, table.length / (4 * COLUMNS), gl.RGBA, gl.FLOAT, table);
    setView(gl, uniforms, view);
    gl.uniform1i(uniforms.headlight, scene.light ? 0 : 1);
    gl.uniform3fv(uniforms.light, scene.light ? orbitDirection(scene.light) : [0, 0, 1]);
    gl.uniform1i(uniforms.look, MODES.indexOf(mode));
    gl.uniform1f(uniforms.low_pass, this._optics.low_pass);
    gl.uniform1f(uniforms.near, NEAR);
    gl.uniform1f(uniforms.texel_step, this._optics.step);
    gl.bindVertexArray(this._vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, this._indices);
    gl.bufferSubData(gl.ARRAY_BUFFER, 0, order);
    gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, order.length);
    gl.bindVertexArray(null);
  }

  // ---- What is on the graphics card ----

  _upload() {
    const gl = this._gl;
    const { count, surfels, lookups, texels } = this._surfels;
    if (!gl.getExtension("EXT_color_buffer_float")) throw new Error(MISSING);
    // Half precision stops adding up faint fragments; where floats cannot be blended it is what there is.
    this._format = gl.getExtension("EXT_float_blend") ? gl.RGBA32F : gl.RGBA16F;
    this._draw = makeProgram(gl, SURFEL_VERTEX, SURFEL_FRAGMENT);
    this._present = makeProgram(gl, PRESENT_VERTEX, PRESENT_FRAGMENT);
    const height = lookups.length / (4 * WIDTH);
    const isSmall = texels instanceof Int8Array;
    const ofTexels = [isSmall ? gl.RGB8I : gl.RGB16I, gl.RGB_INTEGER, isSmall ? gl.BYTE : gl.SHORT];
    const floats = [gl.RGBA32F, gl.RGBA, gl.FLOAT];
    const rows = 1 + lookups.reduce((most, row, k) => (k % 4 === 3 && row > most ? row : most), 0);
    this._textures = {
      surfels: makeTexture(gl, floats, [WIDTH, height, LAYERS.length], surfels),
      lookups: makeTexture(gl, [gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT], [WIDTH, height], lookups),
      texels: makeTexture(gl, ofTexels, [WIDTH, texels.length / (3 * WIDTH)], texels),
      parts: makeTexture(gl, floats, [COLUMNS, rows], null),
    };
    this._target = gl.createFramebuffer();
    this._picture = null;
    this._vertices = gl.createVertexArray();
    this._indices = gl.createBuffer();
    gl.bindVertexArray(this._vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, this._indices);
    gl.bufferData(gl.ARRAY_BUFFER, 4 * count, gl.DYNAMIC_DRAW);
    const place = gl.getAttribLocation(this._draw.program, "surfel");
    gl.enableVertexAttribArray(place);
    gl.vertexAttribIPointer(place, 1, gl.UNSIGNED_INT, 0, 0);
    gl.vertexAttribDivisor(place, 1);
  }

  _resize(width, height) {
    const gl = this._gl;
    if (this._picture && this._size[0] === width && this._size[1] === height) return;
    if (this._picture) gl.deleteTexture(this._picture.texture);
    const type = this._format === gl.RGBA32F ? gl.FLOAT : gl.HALF_FLOAT;
    this._size = [width, height];
    this._picture = makeTexture(gl, [this._format, gl.RGBA, type], this._size, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, this._target);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this._picture.texture, 0);
  }
}

function bind(gl, unit, { texture, target }, uniform) {
  gl.activeTexture(gl.TEXTURE0 + unit);
  gl.bindTexture(target, texture);
  gl.uniform1i(uniform, unit);
}

/** A camera as single-precision numbers: viewmat [12], focal length and size in pixels. */
function viewOf({ viewmat, fov_y: fovY, width, height }) {
  const focal = (0.5 * height) / Math.tan((0.5 * fovY * Math.PI) / 180);
  return { viewmat: Float32Array.from(viewmat.flat()), focal: [focal, focal], size: [width, height] };
}

function setView(gl, uniforms, { viewmat, focal, size }) {
  const [a, b, c, x, d, e, f, y, g, h, i, z] = viewmat;
  gl.uniformMatrix3fv(uniforms.rotation, true, [a, b, c, d, e, f, g, h, i]);
  gl.uniform3f(uniforms.translation, x, y, z);
  gl.uniform2fv(uniforms.focal, focal);
  gl.uniform2fv(uniforms.size, size);
}

/** Unit vector to (azimuth, polar) in degrees, as texgs/core/camera.py has it. */
function orbitDirection({ azimuth, polar }) {
  const [a, p] = [(azimuth * Math.PI) / 180, (polar * Math.PI) / 180];
  return [Math.cos(a) * Math.cos(p), Math.sin(p), -Math.sin(a) * Math.cos(p)];
}
