// How much of the face of a cut each pixel shows, falling to 0 around it, as texgs/scene/cut_view.py finds it.

import { makeProgram } from "./program.js";
import { PRESENT_VERTEX } from "./shaders.js";
import { bind } from "./surfel_pass.js";
import { Target } from "./target.js";
import { GROW_FRAGMENT } from "./volume_shaders.js";

const UNITS = 3, OPAQUE = 0.05; // a face is where so many units of length behind a cut have at least this alpha
const RIM = 0.01; // of the smaller side of the picture
const COARSE = 4; // pixels each way in which faces are looked for at once
const ALPHA = 3; // a channel

export class Faces {
  #gl; #volume; #shaders; #seen; #weights;

  /**
   * @param {WebGL2RenderingContext} gl
   * @param {VolumePass} volume
   */
  constructor(gl, volume) {
    this.#gl = gl;
    this.#volume = volume;
    this.#shaders = makeProgram(gl, PRESENT_VERTEX, GROW_FRAGMENT);
    this.#seen = new Target(gl, [gl.RGBA32F, gl.RGBA, gl.FLOAT]);
    this.#weights = new Target(gl, [gl.RGBA8, gl.RGBA, gl.UNSIGNED_BYTE], gl.LINEAR);
  }

  /** A texture of weights in [0, 1], with a quarter of the pixels of a view each way. */
  weights(view, scene, look) {
    const size = view.size.map((side) => Math.ceil(side / COARSE));
    const focal = view.focal.map((x) => x / COARSE);
    this.#volume.cast(this.#seen, { ...view, size, focal }, scene, look,
      { step: 1, reach: UNITS * this.#volume.unit });
    this.#grow(Math.ceil(RIM * Math.min(...size)));
    return this.#weights.picture;
  }

  #grow(pixels) {
    const gl = this.#gl, { program, uniforms } = this.#shaders;
    this.#weights.begin(this.#seen.size);
    gl.useProgram(program);
    bind(gl, 0, this.#seen.picture, uniforms.picture);
    gl.uniform1i(uniforms.channel, ALPHA);
    gl.uniform1i(uniforms.pixels, pixels);
    gl.uniform1f(uniforms.gain, 1 / OPAQUE);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    this.#weights.end();
  }
}
