// The steps of a series in time that a page holds: how surfels differ from those that it begins with.

import { unpack, wholeNumbers } from "./tensors.js";

export class Steps {
  #first; #texts;

  /**
   * @param {Map} tensors of the models as the page begins, see surfels.js.
   * @param {string[]} texts of the steps, see texgs/viewer/page_steps.py.
   * @param {number[]} held their numbers.
   */
  constructor(tensors, texts, held) {
    this.#first = new Map([...tensors].filter(([name]) => !name.endsWith(".codes"))); // texels stay
    for (const [name, { data }] of this.#first) if (/\.(quats|normals)$/.test(name)) normalize(data);
    this.#texts = new Map(held.map((time, index) => [time, texts[index]]));
  }

  /** The tensors of a step. */
  async at(time) {
    const { tensors, metadata } = await unpack(this.#texts.get(time)), moved = new Map(this.#first);
    const units = Object.entries(JSON.parse(metadata.units));
    for (const [name, codes] of tensors) {
      const [number] = name.split("."), rows = wholeNumbers(codes);
      for (const [key, unit] of units) {
        const first = this.#first.get(`${number}.${key}`);
        if (!first) continue; // not every model has normals of its own
        const { shape, data } = first, columns = shape[1] ?? 1;
        const sums = Float32Array.from(data);
        rows.splice(0, columns).forEach((row, k) => row.forEach((x, i) => { sums[columns * i + k] += unit * x; }));
        moved.set(`${number}.${key}`, { shape, data: sums });
      }
    }
    return moved;
  }
}

/** Gives quaternions length 1. */
function normalize(quats) {
  for (let i = 0; i < quats.length; i += 4) {
    const length = Math.hypot(quats[i], quats[i + 1], quats[i + 2], quats[i + 3]) || 1;
    for (let k = 0; k < 4; k++) quats[i + k] /= length;
  }
}
