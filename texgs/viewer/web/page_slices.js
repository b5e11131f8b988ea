// Slices of the volume that a page holds, see `Slices`: for each sample of the file the nearest one of the page.

import { labelsOf } from "./labels.js";
import { SliceLattice } from "./slice_lattice.js";

const OPAQUE = 0xff000000;
const LEVELS = 255; // the largest code, and white

export class PageSlices {
  #channels; #sizes; #state; #lattice; #offsets;

  /**
   * @param {object} samples codes of `channels` and their `sizes` x, y, z, see samples.js.
   * @param {State} state of the scene, with `slices` and `volume`: see texgs/viewer/page_volume.py.
   */
  constructor({ channels, sizes }, state) {
    const { planes, window } = state.original.slices;
    this.planes = planes;
    this.window = window;
    this.#channels = channels;
    this.#sizes = sizes;
    this.#state = state;
    this.#lattice = new SliceLattice(planes);
    this.#offsets = sizes.map((size, axis) => {
      const { count } = planes.find((plane) => plane.axis[0] === axis), stride = [1, sizes[0], sizes[0] * sizes[1]][axis];
      return Int32Array.from({ length: count }, (_, i) => stride * Math.round(i * (size - 1) / (count - 1)));
    });
  }

  /** What the page has of the file's samples. */
  get words() {
    const { time } = this.#state.original, of = time === null ? "" : ` of step ${time}`;
    const values = this.#hasImage ? `values to the nearest ${Number(this.#step.toPrecision(2))}, ` : "";
    return `In this page: ${values}on ${this.#sizes.join(" × ")} samples${of}.`;
  }

  /** A slice as ImageData: the first channel in grey, and labels over it. */
  slice({ axis, right, up, size: [width, height] }, number, window) {
    const image = new ImageData(width, height), pixels = new Uint32Array(image.data.buffer);
    const base = this.#offset(axis, number), columns = Int32Array.from({ length: width }, (_, x) => this.#offset(right, x));
    const greys = this.#greys(window), paints = this.#paints(greys), [codes] = this.#channels;
    const colors = greys.map((grey) => OPAQUE | (grey << 16) | (grey << 8) | grey);
    for (let y = 0, k = 0; y < height; y++) {
      const row = base + this.#offset(up, height - 1 - y);
      for (let x = 0; x < width; x++, k++) {
        const i = row + columns[x];
        pixels[k] = colors[codes[i]];
        for (const { masks, least, colors: own } of paints) if (masks[i] >= least) pixels[k] = own[codes[i]];
      }
    }
    return image;
  }

  /** What is at the sample nearest to a point of the world. */
  place(point) {
    const { matrix } = this.#state.original.slices, index = this.#lattice.nearest(point), at = this.#lattice.pointOf(index);
    const i = this.planes.reduce((sum, { axis }, k) => sum + this.#offset(axis, index[k]), 0);
    const { low, high } = this.#facts[0], value = low + this.#channels[0][i] / LEVELS * (high - low);
    const digits = Math.min(20, Math.max(0, -Math.floor(Math.log10(this.#step))));
    return {
      index,
      position: matrix.slice(0, 3).map((row) => row[3] + at.reduce((sum, x, axis) => sum + row[axis] * x, 0)),
      value: this.#hasImage ? Number(value.toFixed(digits)) : null,
      labels: this.#labels.filter(({ channel, half }) => this.#channels[channel][i] >= LEVELS * half).map(({ name }) => name),
    };
  }

  get #facts() {
    return this.#state.original.volume.channels;
  }

  get #step() {
    return this.#state.original.slices.step;
  }

  get #labels() {
    return labelsOf(this.#state.scene, this.#facts);
  }

  /** Whether the first channel is more than a label. */
  get #hasImage() {
    return !this.#labels.some(({ channel }) => channel === 0);
  }

  /** Where the samples at a number along an axis of the grid, or against it, are among the codes. */
  #offset([axis, sign], number) {
    const offsets = this.#offsets[axis];
    return offsets[sign > 0 ? number : offsets.length - 1 - number];
  }

  /** Grey levels [256] of the codes of the first channel. */
  #greys([from, to]) {
    const { low, high } = this.#facts[0];
    return Uint32Array.from({ length: LEVELS + 1 }, (_, code) => {
      const share = (low + code / LEVELS * (high - low) - from) / Math.max(to - from, Number.MIN_VALUE);
      return this.#hasImage ? Math.round(LEVELS * Math.min(1, Math.max(0, share))) : 0;
    });
  }

  /** Labels that are visible: their masks, and their colours [256] over each grey level of a code. */
  #paints(greys) {
    return this.#labels.filter(({ color }) => color).map(({ channel, half, color, cover }) => {
      const mixed = (grey, c) => Math.round((1 - cover) * grey + cover * LEVELS * color[c]) << (8 * c);
      const colors = greys.map((grey) => OPAQUE | mixed(grey, 0) | mixed(grey, 1) | mixed(grey, 2));
      return { masks: this.#channels[channel], least: LEVELS * half, colors };
    });
  }
}
