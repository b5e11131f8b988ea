// Draws a scene of surfels by WebGL2: sorted, blended far to near into floats, then shown.

import { direction } from "./camera.js";
import { Harmonics, SurfelLight } from "./exposure.js";
import { COLUMNS, firstRows, partTable } from "./parts.js";
import { makeProgram } from "./program.js";
import { samplesOf } from "./samples.js";
import { MODES, PAIRS, PRESENT_FRAGMENT, PRESENT_VERTEX } from "./shaders.js";
import { sizeOf } from "./size.js";
import { DepthOrder } from "./sort.js";
import { Steps } from "./steps.js";
import { NEAR, SurfelPass, bind } from "./surfel_pass.js";
import { joinSurfels, placeSurfels } from "./surfels.js";
import { unpack } from "./tensors.js";
import { withAlpha } from "./transparent.js";
import { OF_TWIN, Twin, alone } from "./twin.js";

const OVER_BLACK = ["alpha", "ambient", "diffuse", "specular", "shininess"];
const SLOW = 40; // milliseconds of a frame above which those of a moving scene have fewer rows and columns
const LEAST = 1 / 4; // part of them that stays
const LONGEST = 1000; // milliseconds that count: a page may have been hidden meanwhile
const MISSING = "This browser has no WebGL2, which this scene needs: switch hardware acceleration on, or use another one.";
const CONTEXT = { alpha: false, antialias: false, depth: false, powerPreference: "high-performance" };

export class WebglRenderer {
  /**
   * @param {HTMLCanvasElement} canvas to draw on; its size follows that on the page.
   * @param {function(string)} notice tells the user what went wrong, "" that it is over.
   * @throws {Error} where there is no WebGL2.
   */
  constructor(canvas, notice) {
    this.modes = MODES;
    this._canvas = canvas;
    const gl = canvas.getContext("webgl2", CONTEXT);
    if (!gl) throw new Error(MISSING);
    this._gl = gl;
    this._notice = notice;
    this._share = 1; // of the sides of a frame, while something moves
    this.took = 0; // milliseconds of the latest of these frames
    this.onframe = () => {}; // is called with what a frame shows that is on its way to the canvas
    canvas.addEventListener("webglcontextlost", (event) => {
      event.preventDefault(); // asks for another context
      this._begun = null;
      notice("The graphics driver has taken the picture back; it comes again by itself.");
    });
    canvas.addEventListener("webglcontextrestored", () => {
      this._upload();
      notice("");
      this._ask();
    });
  }

  /**
   * Takes the surfels of a scene.
   *
   * @param {string} packed their tensors, see tensors.js.
   * @param {object} scene its description; models and segments may not change later, their edits may.
   * @param {string} volume its samples, where the page has them.
   * @param {string[]} steps those of its series that the page holds, see steps.js.
   */
  async open(packed, scene, volume = "", steps = []) {
    const { tensors, metadata } = await unpack(packed);
    this._original = scene;
    this._optics = JSON.parse(metadata.optics);
    this._surfels = joinSurfels(tensors, this._optics.models, firstRows(scene.models));
    this._steps = new Steps(tensors, steps, scene.held ?? []);
    this._time = scene.time; // where the surfels are
    this._turn = Promise.resolve(); // of who needs them at a step
    const { models, exposure } = this._optics;
    this._harmonics = exposure ? new Harmonics(tensors, models.length, exposure) : null;
    this._order = new DepthOrder(this._surfels.lookups.length / 4);
    this._samples = volume ? samplesOf((await unpack(volume)).tensors, scene.volume.channels.length) : null;
    if (volume) this.modes = MODES.toSpliced(1, 0, ...OF_TWIN);
    this._upload();
  }

  /** Those of the volume in the page, see samples.js; null where it has none. */
  get samples() {
    return this._samples;
  }

  /** Size of the picture in pixels of the screen. */
  size() {
    return sizeOf(this._canvas);
  }

  /**
   * Asks for a frame; of several, the newest wins.
   *
   * @param {OrbitCamera} camera
   * @param {object} scene description with its edits, light and background.
   * @param {object} how `mode`; whether to show the scene as it was `before`; whether something is `moving`: then
   *   slow frames are coarser; `gain` of a difference, and the part of the width before the line of a `wipe`.
   */
  draw(camera, scene, { before = false, ...shown } = {}) {
    this._wanted = { view: this._view(camera), scene: before ? this._before(scene) : scene, shown: { ...shown, before } };
    this._ask();
  }

  /** Whether the newest frame that is asked for has not begun. */
  get isBusy() {
    return this._isAsked;
  }

  /** Does something while the surfels are where they are at a step; who asks later waits. */
  at(time, act) {
    const done = this._turn.then(async () => {
      if (time !== this._time) {
        placeSurfels(this._surfels.surfels, await this._steps.at(time), this._optics.models.length);
        this._pass.place(this._surfels.surfels);
        this._time = time;
        this._sorted = "";
      }
      return act();
    });
    this._turn = done.catch(() => {});
    return done;
  }

  /** Moves the line between two pictures. */
  wipe(part) {
    if (this._wanted) this._wanted.shown.wipe = part;
    this._ask();
  }

  /** The point [3] that a pixel shows; null for the background. */
  pointAt(camera, scene, { before, mode }, [x, y]) {
    const view = this._view(camera), pixel = [x, y].map((side) => side + 0.5), shown = before ? this._before(scene) : scene;
    const look = lookOf(shown), isVolume = this._hasTwin(shown) && (mode === "shaded" || OF_TWIN.includes(mode));
    if (isVolume) this._twin.drawDepths(viewOf(view), mode === "volume" ? shown : { ...shown, functions: {} }, look);
    else this._blend(viewOf(view), shown, look, { mode: "depth" });
    const depth = (isVolume ? this._twin : this._pass).target.depthAt(x, y);
    return depth && camera.unproject(pixel, depth, view.width, view.height);
  }

  /** The same picture as a canvas of its own; of another size, or without its background, if need be. */
  async still(camera, scene, { before, ...how }) {
    if (this._gl.isContextLost()) throw new Error("The graphics driver has taken the picture back; try again when it is there.");
    const view = this._view(camera), shown = before ? this._before(scene) : scene;
    return this.at(shown.time, () => this._still(view, shown, how));
  }

  _still(onScreen, shown, { size = this.size(), transparent = false, ...how }) {
    const [width, height] = size, view = { ...onScreen, width, height }, still = { ...how, moving: false };
    const over = (grey) => this.pixels(view, { ...shown, background: [grey, grey, grey] }, still);
    const pixels = transparent ? withAlpha(over(0), over(1)) : this.pixels(view, shown, still);
    if (this._wanted) this._frame(this._wanted.view, this._wanted.scene, this._wanted.shown); // on screen again
    const canvas = Object.assign(document.createElement("canvas"), { width, height });
    canvas.getContext("2d").putImageData(new ImageData(pixels, width, height), 0, 0);
    return canvas;
  }

  /**
   * Draws now.
   *
   * @param {object} view viewmat [3, 4] world to camera (OpenCV axes), fov_y in degrees, width and height.
   * @param {object} shown as `draw` has it.
   * @returns {Uint8ClampedArray} the picture [H, W, 4], first row on top.
   */
  pixels(view, scene, shown) {
    this._frame(view, scene, shown);
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

  // ---- Frames ----

  _view(camera) {
    const [width, height] = this.size();
    return { viewmat: camera.viewmat(), fov_y: camera.fov_y, width, height };
  }

  _ask() {
    this._isAsked = true;
    this._canvas.setAttribute("aria-busy", "true"); // until a whole frame is there
    this._request ||= requestAnimationFrame(() => this._tick());
  }

  /** Draws the newest frame that is asked for, once the one before is done: events come in time meanwhile. */
  _tick() {
    const gl = this._gl;
    this._request = 0;
    if (gl.isContextLost() || !this._wanted) return;
    const isDone = !this._begun || gl.getSyncParameter(this._begun.fence, gl.SYNC_STATUS) === gl.SIGNALED;
    if (isDone && this._begun) this._note(this._begun);
    if (isDone && this._isAsked && this._wanted.scene.time === this._time) this._begin(this._wanted);
    else if (isDone && this._isAsked) this._going ??= this._go(this._wanted.scene.time);
    if (this._begun) this._request = requestAnimationFrame(() => this._tick());
  }

  /** Puts the surfels where they are at a step, for the newest frame. */
  async _go(time) {
    try {
      await this.at(time, () => this._ask());
    } catch (error) {
      this._notice(error.message);
    }
    this._going = null;
  }

  _begin({ view, scene, shown }) {
    const gl = this._gl, { moving } = shown, share = moving ? this._share : 1, at = performance.now();
    const [width, height] = [view.width, view.height].map((side) => Math.ceil(share * side));
    this._isAsked = false;
    this.onframe(shown);
    this._frame({ ...view, width, height }, scene, shown);
    this._begun = { at, share, moving, fence: gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0) };
    gl.flush();
  }

  /** Notes how long a frame took; a whole one counts while moving ones are whole, too. */
  _note({ at, share, moving, fence }) {
    const took = Math.min(performance.now() - at, LONGEST);
    const part = Math.min(1, Math.max(LEAST, share * Math.sqrt(SLOW / took)));
    const isOther = part === 1 || part === LEAST || part < 0.8 * share || part > 1.25 * share; // else sharpness would waver
    this._gl.deleteSync(fence);
    this._begun = null;
    if (moving) this.took = took;
    else if (!this._isAsked) this._canvas.setAttribute("aria-busy", "false");
    if (share === this._share && isOther) this._share = part;
  }

  _frame(camera, scene, { mode = "shaded", moving = false, gain = 1, wipe = 1 } = {}) {
    const gl = this._gl;
    const { width, height } = camera;
    if (this._canvas.width !== width) this._canvas.width = width;
    if (this._canvas.height !== height) this._canvas.height = height;
    const { first, second, pair } = this._pictures(viewOf(camera), scene, mode, moving);
    const range = mode === "depth" ? this._pass.depths() : [0, 0];
    const { program, uniforms } = this._present;
    gl.viewport(0, 0, width, height);
    gl.useProgram(program);
    bind(gl, 0, first, uniforms.picture);
    bind(gl, 1, second, uniforms.other);
    gl.uniform1i(uniforms.pair, PAIRS.indexOf(pair));
    gl.uniform1f(uniforms.gain, gain);
    gl.uniform1f(uniforms.wipe, wipe);
    gl.uniform2fv(uniforms.range, range);
    gl.uniform3fv(uniforms.background, OVER_BLACK.includes(mode) ? [0, 0, 0] : scene.background);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
  }

  /** The scene as it was opened, at the step that another shows. */
  _before({ time }) {
    return { ...this._original, time };
  }

  /** Whether the volume of a scene is there: that of other steps is not in the page. */
  _hasTwin(scene) {
    return this._twin && scene.time === this._original.time;
  }

  /** The scene without shadows at steps other than that of which its light is known. */
  _lit(scene) {
    return scene.time === this._original.time ? scene : { ...scene, can_shadow: false };
  }

  /** The picture of a mode, or two and how they are shown. */
  _pictures(view, scene, mode, moving) {
    const look = lookOf(scene), draw = (slab) => this._blend(view, scene, look, { mode, moving, slab });
    if (!this._hasTwin(scene) || (mode !== "shaded" && !OF_TWIN.includes(mode))) return alone(draw());
    return this._twin.pictures(view, scene, look, { mode, moving }, { draw, target: this._pass.target });
  }

  /** Blends the surfels; on the canvas nothing changes. */
  _blend(view, scene, look, { mode, moving = false, slab }) {
    const exposure = this._light.of(this._lit(scene), look, moving);
    const table = partTable(scene.models, this._optics.models), of = OF_TWIN.includes(mode) ? "shaded" : mode;
    return this._pass.blend(view, { ...look, exposure, mode: MODES.indexOf(of) }, table, this._sort(view, table), slab);
  }

  /** Surfels beyond the near plane whose part is visible, far to near, by depths rounded as the rasterizer's. */
  _sort({ viewmat }, table) {
    const { count, surfels, lookups } = this._surfels;
    const [x, y, z, t] = viewmat.slice(8);
    const order = this._order;
    const round = Math.fround;
    const shown = table.filter((_, k) => k % (4 * COLUMNS) === 3).map(Math.sign), key = [x, y, z, t, ...shown].join();
    if (key === this._sorted) return order.latest;
    this._sorted = key;
    order.clear();
    for (let i = 0, k = 0; i < count; i++, k += 4) {
      const sum = round(y * surfels[k + 1] + round(z * surfels[k + 2]));
      const depth = round(round(x * surfels[k] + sum) + t);
      if (depth > NEAR && table[4 * COLUMNS * lookups[k + 3] + 3] > 0) order.add(i, depth);
    }
    return order.farToNear();
  }

  _upload() {
    const rows = partTable(this._original.models, this._optics.models).length / (4 * COLUMNS);
    this._pass = new SurfelPass(this._gl, this._surfels, this._optics, rows);
    this._twin = this._samples && new Twin(this._gl, this._samples, this._original.volume);
    this._light = new SurfelLight(this._surfels, this._harmonics, this._twin);
    this._present = makeProgram(this._gl, PRESENT_VERTEX, PRESENT_FRAGMENT);
  }
}

/** Direction to the light, null for a headlight, and planes that cut. */
function lookOf({ light, cuts }) {
  return { light: light && direction(light.azimuth, light.polar), planes: halfSpaces(cuts) };
}

/** All planes of cuts, with the sides of a box. */
function halfSpaces({ planes, box }) {
  const side = (axis, sign, corner) =>
    ({ normal: [0, 1, 2].map((i) => i === axis ? sign : 0), offset: sign * corner[axis] });
  return [...planes, ...(box ? [0, 1, 2].flatMap((i) => [side(i, 1, box.high), side(i, -1, box.low)]) : [])];
}

/** A camera as single-precision numbers: viewmat [12], focal length and size in pixels. */
function viewOf({ viewmat, fov_y: fovY, width, height }) {
  const focal = (0.5 * height) / Math.tan((0.5 * fovY * Math.PI) / 180);
  return { viewmat: Float32Array.from(viewmat.flat()), focal: [focal, focal], size: [width, height] };
}
