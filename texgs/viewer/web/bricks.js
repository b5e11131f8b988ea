// Bricks of 4 x 4 x 4 cells of a volume: their extremes, and how far each is from one in which something shows.

export const BRICK = 4; // cells of a side
const FARTHEST = 255;

export class Bricks {
  size; // with one more brick on each side, so that all have neighbours
  #lows; #highs; #strides; #before;

  /**
   * @param {Uint8Array} codes of samples [Z, Y, X].
   * @param {number[]} sizes x, y, z.
   */
  constructor(codes, sizes) {
    this.size = sizes.map((side) => Math.ceil((side - 1) / BRICK) + 2);
    const [x, y] = this.size;
    this.#strides = [1, x, x * y];
    this.#before = neighbours(this.#strides);
    this.#lows = new Uint8Array(x * y * this.size[2]).fill(255);
    this.#highs = new Uint8Array(this.#lows.length);
    this.#find(codes, sizes);
  }

  /** Distances [Z, Y, X] in bricks to the nearest that has a value with extinction in a table. */
  distances(table) {
    const seen = countsOf(table), last = table.length / 4 - 1, distances = new Uint8Array(this.#lows.length).fill(FARTHEST);
    for (let i = 0; i < distances.length; i++) {
      if (this.#lows[i] > this.#highs[i]) continue;
      const low = Math.floor(this.#lows[i] / 255 * last) - 1, high = Math.ceil(this.#highs[i] / 255 * last) + 1;
      if (seen[Math.min(high, last) + 1] > seen[Math.max(low, 0)]) distances[i] = 0;
    }
    this.#spread(distances, 1);
    this.#spread(distances, -1);
    return distances;
  }

  /** Let bricks learn from the neighbours before them, or with sign -1 from those behind. */
  #spread(distances, sign) {
    const [nx, ny, nz] = this.size, [, row, plane] = this.#strides, first = sign > 0 ? 0 : distances.length - 1;
    for (let z = 1; z < nz - 1; z++) for (let y = 1; y < ny - 1; y++) for (let x = 1; x < nx - 1; x++) {
      const i = first + sign * (z * plane + y * row + x);
      for (const step of this.#before) distances[i] = Math.min(distances[i], distances[i - sign * step] + 1);
    }
  }

  #find(codes, sizes) {
    const [nx, ny, nz] = this.size, [, row, plane] = this.#strides;
    for (let z = 1; z < nz - 1; z++) for (let y = 1; y < ny - 1; y++) for (let x = 1; x < nx - 1; x++) {
      this.#findOf(z * plane + y * row + x, [x, y, z].map((at) => BRICK * (at - 1)), codes, sizes);
    }
  }

  #findOf(brick, [left, top, front], codes, [nx, ny, nz]) {
    const end = (start, size) => Math.min(start + BRICK, size - 1);
    let low = 255, high = 0;
    for (let z = front; z <= end(front, nz); z++) for (let y = top; y <= end(top, ny); y++) {
      for (let i = (z * ny + y) * nx + left; i <= (z * ny + y) * nx + end(left, nx); i++) {
        low = Math.min(low, codes[i]);
        high = Math.max(high, codes[i]);
      }
    }
    this.#lows[brick] = low;
    this.#highs[brick] = high;
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
