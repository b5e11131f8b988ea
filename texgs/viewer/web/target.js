// A picture that is drawn into, which has the size of the latest view.

import { makeTexture } from "./program.js";

const FAINT = 0.1; // alpha below which a pixel counts as background, as the server has it

export class Target {
  size = [0, 0];
  picture = null; // a texture whose first row is on top
  #gl; #filter; #framebuffer;

  /** @param {number[]} format internal format, format and type. */
  constructor(gl, format, filter = gl.NEAREST) {
    this.#gl = gl;
    this.format = format;
    this.#filter = filter;
    this.#framebuffer = gl.createFramebuffer();
  }

  /** Draw into it from now on; it is empty, or holds what was drawn before. */
  begin(size, holds = false) {
    const gl = this.#gl;
    this.bind();
    if (size.some((side, k) => side !== this.size[k])) this.#resize(size);
    gl.viewport(0, 0, ...size);
    if (!holds) gl.clearBufferfv(gl.COLOR, 0, [0, 0, 0, 0]);
  }

  /** Draw into it, or read it. */
  bind() {
    this.#gl.bindFramebuffer(this.#gl.FRAMEBUFFER, this.#framebuffer);
  }

  /** Draw on the screen again. */
  end() {
    this.#gl.bindFramebuffer(this.#gl.FRAMEBUFFER, null);
  }

  /** The mean depth of a pixel, where depths were drawn; null for the background. */
  depthAt(x, y) {
    const gl = this.#gl, pixel = new Float32Array(4);
    this.bind();
    gl.readPixels(x, y, 1, 1, gl.RGBA, gl.FLOAT, pixel);
    this.end();
    return pixel[3] < FAINT ? null : pixel[0] / pixel[3];
  }

  #resize(size) {
    const gl = this.#gl;
    if (this.picture) gl.deleteTexture(this.picture.texture);
    this.size = [...size];
    this.picture = makeTexture(gl, this.format, size, null, { filter: this.#filter });
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, this.picture.texture, 0);
  }
}
