// Bricks of 4 x 4 x 4 cells of a volume: their extremes, and how far each is from one in which something shows.

export const BRICK = 4; // cells of a side
const FARTHEST = 255;

export class Bricks {
  size; // with one more brick on each side, so that all have neighbours
  #extremes; #strides; #before;

  /**
   * @param {Uint8Array[]} channels codes of samples [Z, Y, X].
   * @param {number[]} sizes x, y, z.
   */
  constructor(channels, sizes) {
    this.size = sizes.map((side) => Math.ceil((side - 1) / BRICK) + 2);
    const [x, y] = this.size;
    this.#strides = [1, x, x * y];
    this.#before = neighbours(this.#strides);
    const count = x * y * this.size[2];
    this.#extremes = channels.map((codes) => {
      const own = { lows: new Uint8Array(count).fill(255), highs: new Uint8Array(count) };
      this.#find(codes, sizes, own);
      return own;
    });
  }

  /** Distances [Z, Y, X] in bricks to the nearest that has a value with extinction in a table, see function_table.js. */
  distances(tables) {
    const distances = new Uint8Array(this.#strides[2] * this.size[2]).fill(FARTHEST);
    for (const each of tables) this.#mark(distances, each);
    this.#spread(distances, 1);
    this.#spread(distances, -1);
    return distances;
  }

  #mark(distances, { table, channel, mask, half }) {
    const seen = countsOf(table), last = table.length / 4 - 1, { lows, highs } = this.#extremes[channel];
    for (let i = 0; i < distances.length; i++) {
      if (lows[i] > highs[i] || this.#extremes[mask]?.highs[i] < 255 * half) continue;
      const low = Math.floor(lows[i] / 255 * last) - 1, high = Math.ceil(highs[i] / 255 * last) + 1;
      if (seen[Math.min(high, last) + 1] > seen[Math.max(low, 0)]) distances[i] = 0;
    }
  }

  /** Let bricks learn from the neighbours before them, or with sign -1 from those behind. */
  #spread(distances, sign) {
    const [nx, ny, nz] = this.size, [, row, plane] = this.#strides, first = sign > 0 ? 0 : distances.length - 1;
    for (let z = 1; z < nz - 1; z++) for (let y = 1; y < ny - 1; y++) for (let x = 1; x < nx - 1; x++) {
      const i = first + sign * (z * plane + y * row + x);
      for (const step of this.#before) distances[i] = Math.min(distances[i], distances[i - sign * step] + 1);
    }
  }

  #find(codes, sizes, extremes) {
    const [nx, ny, nz] = this.size, [, row, plane] = this.#strides;
    for (let z = 1; z < nz - 1; z++) for (let y = 1; y < ny - 1; y++) for (let x = 1; x < nx - 1; x++) {
      this.#findOf(z * plane + y * row + x, [x, y, z].map((at) => BRICK * (at - 1)), codes, sizes, extremes);
    }
  }

  #findOf(brick, [left, top, front], codes, [nx, ny, nz], { lows, highs }) {
    const end = (start, size) => Math.min(start + BRICK, size - 1);
    let low = 255, high = 0;
    for (let z = front; z <= end(front, nz); z++) for (let y = top; y <= end(top, ny); y++) {
      for (let i = (z * ny + y) * nx + left; i <= (z * ny + y) * nx + end(left, nx); i++) {
        low = Math.min(low, codes[i]);
        high = Math.max(high, codes[i]);
      }
    }
    lows[brick] = low;
    highs[brick] = high;
  }
}

/** Steps to the neighbours that a pass over rows and planes meets before. */
function neighbours(strides) {
  const sides = [-1, 0, 1];
  return sides.flatMap((z) => sides.flatMap((y) => sides.map((x) => z * strides[2] + y * strides[1] + x * strides[0])))
    .filter((step) => step > 0);
}

/** How many entries of a table before each show something. */
function countsOf(table) {
  const counts = new Uint32Array(table.length / 4 + 1);
  for (let i = 0; i < table.length / 4; i++) counts[i + 1] = counts[i] + Number(table[4 * i + 3] > 0);
  return counts;
}
