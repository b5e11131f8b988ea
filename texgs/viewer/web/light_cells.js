// What hides light inside of a volume: extinctions of cells, and which shares of light reach them, as
// texgs/raster/csrc/cpu/light_sweep.cpp has them. Columns run in the light's direction, from slice to slice of cells.

import { integralsOf } from "./function_table.js";

const CODES = 256;
const RIM = 1; // empty cells around a volume, as in texgs/volume/matter.py
const OUTSET = 2.5; // cells along its normal from which light comes to a place, as in texgs/volume/light_cells.py
const MOST = 16; // extinction of an edge of a cell: cells that opaque matter only touches stay bright
const FINENESS = 256; // steps of a logarithm to base 2 of light
const FAINT = 16; // such a logarithm, from which on there is no light

/** All light is there: cells as `lit` returns them. */
export const EVERYWHERE = { size: [1, 1, 1], half: [1, 1, 1], values: new Uint8Array([255]), edge: 2, outset: 0 };

/** Light in 255ths by its logarithm, in steps; the first is all of it. */
const LIGHT = Float32Array.from({ length: FAINT * FINENESS }, (_, i) => 255 * 2 ** (-i / FINENESS));
const mix = (a, b, t) => a + t * (b - a);

export class Matter {
  /** Cells: `values` [Z, Y, X] are logarithms to base 2, negated, of the light that a world unit lets through. */
  extinctions;
  #samples; #box; #half; #size; #extinction;

  /**
   * What functions show of a volume, where no cut is.
   *
   * @param {object} samples codes of `channels` and their `sizes` x, y, z, see samples.js.
   * @param {object} facts half the sides of the box, and appearance: `volume` of the description of a scene.
   * @param {number} longest side, in cells without the rim; no cell is smaller than those between samples.
   * @param {object[]} tables see function_table.js.
   * @param {object[]} planes that cut: `normal` and `offset`.
   */
  constructor(samples, { half, appearance: { opacity_unit: unit } }, longest, tables, planes) {
    this.#samples = samples;
    this.#box = half;
    const inner = samples.sizes.map((count, axis) =>
      Math.max(1, Math.min(count - 1, Math.round((longest * half[axis]) / Math.max(...half)))));
    this.#size = inner.map((count) => count + 2 * RIM);
    this.#half = half.map((each, axis) => (each * this.#size[axis]) / inner[axis]);
    this.#extinction = new Float32Array(this.#size[0] * this.#size[1] * this.#size[2]);
    this.extinctions = this.#cells(this.#extinction);
    for (const each of tables) this.#fill(each, meansBetween(each.table, (MOST * unit) / this.extinctions.edge), unit, planes);
  }

  /**
   * The share of a distant light that reaches the centre of each cell.
   *
   * @param {number[]} direction to it, of length 1.
   * @returns {{size: number[], half: number[], values: Uint8Array, edge: number, outset: number}} values [Z, Y, X] in
   *   255ths of cells that fill a box; their shortest edge and the outset in world units.
   */
  lit(direction) {
    return this.#mean([direction], Infinity, 1);
  }

  /** Twice the mean share of lights from all around, at most 1, as `lit`; only matter within a reach hides them. */
  opened(reach, directions) {
    return this.#mean(directions, reach, 2);
  }

  #mean(directions, reach, factor) {
    const sums = new Float32Array(this.#extinction.length), share = factor / directions.length;
    for (const direction of directions) this.#follow(direction, reach, sums);
    return this.#cells(new Uint8ClampedArray(sums.map((sum) => share * sum))); // which rounds
  }

  #cells(values) {
    const edge = Math.min(...[0, 1, 2].map((axis) => this.#edge(axis)));
    return { size: this.#size, half: this.#half, values, edge, outset: OUTSET * edge };
  }

  /** World units. */
  #edge(axis) {
    return 2 * this.#half[axis] / this.#size[axis];
  }

  /** Adds mean extinctions, of the diagonals between samples, as values are linear along them. */
  #fill({ channel, mask, half }, means, unit, planes) {
    const { channels, sizes: [nx, ny, nz] } = this.#samples, [sx, sy] = this.#size, plane = nx * ny;
    const codes = channels[channel], masks = channels[mask], least = 8 * 255 * half; // of the sum of eight corners
    const [ofX, ofY, ofZ] = [0, 1, 2].map((axis) => this.#places(axis));
    const cuts = planes.map((each) => inSides(each, ofX.side));
    for (let z = 0; z < nz - 1; z++) for (let y = 0; y < ny - 1; y++) {
      const row = (ofZ.cell[z] * sy + ofY.cell[y]) * sx, share = ofZ.share[z] * ofY.share[y] / (4 * unit);
      for (let x = 0, i = (z * ny + y) * nx; x < nx - 1; x++, i++) {
        const j = i + nx, k = i + plane, l = j + plane;
        const sum = means[CODES * codes[i] + codes[l + 1]] + means[CODES * codes[i + 1] + codes[l]]
          + means[CODES * codes[j] + codes[k + 1]] + means[CODES * codes[j + 1] + codes[k]];
        if (sum === 0) continue;
        if (masks && masks[i] + masks[i + 1] + masks[j] + masks[j + 1] + masks[k] + masks[k + 1] + masks[l] + masks[l + 1] < least) continue;
        const left = cuts.length ? leftOf(cuts, ofX.at[x], ofY.at[y], ofZ.at[z]) : 1;
        this.#extinction[row + ofX.cell[x]] += left * sum * share * ofX.share[x];
      }
    }
  }

  /** Of the middles between samples along an axis: the cell of each, its share of that, and where it is. */
  #places(axis) {
    const count = this.#samples.sizes[axis] - 1, cells = this.#size[axis] - 2 * RIM, side = 2 * this.#box[axis] / count;
    const cell = Int32Array.from({ length: count }, (_, i) => RIM + Math.floor((i + 0.5) * cells / count));
    const counts = new Int32Array(cells + 2 * RIM);
    for (const each of cell) counts[each] += 1;
    const at = Float32Array.from(cell, (_, i) => (i + 0.5) * side - this.#box[axis]);
    return { cell, share: Float32Array.from(cell, (each) => 1 / counts[each]), at, side };
  }

  /** Adds the shares of a light to sums, in 255ths, as far as matter within a reach hides it. */
  #follow(direction, reach, sums) {
    const c = this.#columns(direction), slice = new Float32Array((c.nu + 2) * (c.nv + 2)); // between zeros
    const met = new Float32Array(c.wide * c.high), depths = new Float32Array(met.length);
    const most = Math.max(1, Math.round(reach / c.length)); // slices
    for (let i = 0; i < c.slices; i++) {
      depths.set(met);
      this.#meet(c, i, c.length, slice, met, depths);
      if (i >= most) this.#meet(c, i - most, -c.length, slice, met, depths);
      toLight(depths);
      this.#add(c, i, depths, sums);
    }
  }

  /** Columns that fill all slices: at slice i, column U is at the place U + slope * i - base. */
  #columns(direction) {
    const along = direction.map((x, axis) => x / this.#edge(axis)), [nx, ny] = this.#size, strides = [1, nx, nx * ny];
    const w = along.reduce((best, x, axis) => Math.abs(x) > Math.abs(along[best]) ? axis : best, 0);
    const [u, v] = [0, 1, 2].filter((axis) => axis !== w), slices = this.#size[w];
    const slope = [u, v].map((axis) => -along[axis] / Math.abs(along[w]));
    const far = slope.map((x) => x * (slices - 1)), base = far.map((x) => Math.max(0, Math.ceil(x)));
    const [wide, high] = [u, v].map((axis, k) => this.#size[axis] + base[k] + Math.max(0, Math.ceil(-far[k])) + 1);
    const [first, next] = along[w] > 0 ? [(slices - 1) * strides[w], -strides[w]] : [0, strides[w]];
    return {
      slices, slope, base, wide, high, nu: this.#size[u], nv: this.#size[v], length: 1 / Math.abs(along[w]),
      first, next, du: strides[u], dv: strides[v],
    };
  }

  /** Adds a part of what columns meet in a slice to sums, and half of it to depths. */
  #meet(c, i, part, slice, sums, depths) {
    const [u, v] = c.slope.map((slope, k) => split(slope * i - c.base[k])), stride = c.nu + 2;
    for (let y = 0; y < c.nv; y++) {
      const from = c.first + i * c.next + y * c.dv, to = (y + 1) * stride + 1;
      for (let x = 0; x < c.nu; x++) slice[to + x] = this.#extinction[from + x * c.du];
    }
    const end = Math.min(c.wide, c.nu - u.whole);
    for (let V = Math.max(0, -1 - v.whole); V < Math.min(c.high, c.nv - v.whole); V++) {
      let U = Math.max(0, -1 - u.whole), from = (V + v.whole + 1) * stride + U + u.whole + 1, k = V * c.wide + U;
      let one = mix(slice[from], slice[from + stride], v.rest);
      for (from += 1; U < end; U++, from++, k++) {
        const other = mix(slice[from], slice[from + stride], v.rest), extinction = part * mix(one, other, u.rest);
        sums[k] += extinction;
        depths[k] += 0.5 * extinction;
        one = other;
      }
    }
  }

  /** Adds light at the centres of a slice's cells, from that of columns. */
  #add(c, i, light, sums) {
    const [u, v] = c.slope.map((slope, k) => split(c.base[k] - slope * i));
    for (let y = 0; y < c.nv; y++) {
      let from = (y + v.whole) * c.wide + u.whole, one = mix(light[from], light[from + c.wide], v.rest);
      for (let x = 0, k = c.first + i * c.next + y * c.dv; x < c.nu; x++, k += c.du) {
        from += 1;
        const other = mix(light[from], light[from + c.wide], v.rest);
        sums[k] += mix(one, other, u.rest);
        one = other;
      }
    }
  }
}

/** Unit vectors evenly over the sphere, as texgs/volume/matter.py has them. */
export function evenDirections(count) {
  return Array.from({ length: count }, (_, i) => {
    const height = (i + 0.5) * (2 / count) - 1, turn = i * Math.PI * (1 + Math.sqrt(5));
    const radius = Math.sqrt(1 - height * height);
    return [radius * Math.cos(turn), radius * Math.sin(turn), height];
  });
}

/** The value at a place of the world, linear between centres of cells, beyond them that of the nearest. */
export function valueAt({ size: [nx, ny, nz], half: [hx, hy, hz], values }, x, y, z) {
  const u = placeOf(x, hx, nx), v = placeOf(y, hy, ny), w = placeOf(z, hz, nz);
  const i = cellOf(u, nx), j = cellOf(v, ny), k = cellOf(w, nz), first = (k * ny + j) * nx + i;
  const right = nx > 1 ? 1 : 0, row = ny > 1 ? nx : 0, plane = nz > 1 ? nx * ny : 0;
  const along = (at) => mix(values[at], values[at + right], u - i);
  const across = (at) => mix(along(at), along(at + row), v - j);
  return mix(across(first), across(first + plane), w - k);
}

/** Cells from the first centre. */
function placeOf(x, half, count) {
  return Math.min(count - 1, Math.max(0, (0.5 + (0.5 * x) / half) * count - 0.5));
}

/** The centre before a place, which has another behind it where there are two. */
function cellOf(place, count) {
  return Math.max(0, Math.min(Math.floor(place), count - 2));
}

/** Turns depths into light, in 255ths. */
function toLight(depths) {
  for (let k = 0; k < depths.length; k++) {
    const depth = Math.max(0, depths[k]);
    depths[k] = depth < FAINT ? LIGHT[Math.floor(depth * FINENESS)] : 0;
  }
}

/** A whole number of steps, and the rest below 1. */
function split(shift) {
  return { whole: Math.floor(shift), rest: shift - Math.floor(shift) };
}

/** A plane as numbers that count distances from it in the sides of a cube. */
function inSides({ normal, offset }, side) {
  const length = side * Math.hypot(...normal), [a, b, c] = normal.map((x) => x / length);
  return { a, b, c, d: offset / length };
}

/** The part of a cube around a place that cuts leave. */
function leftOf(cuts, x, y, z) {
  let left = 1;
  for (let i = 0; i < cuts.length; i++) {
    const { a, b, c, d } = cuts[i];
    left *= Math.min(1, Math.max(0, 0.5 + d - a * x - b * y - c * z));
  }
  return left;
}

/** Mean extinctions of all values between two codes [256, 256], of each at most so much. */
function meansBetween(functions, most) {
  const table = functions.map((x, k) => k % 4 === 3 ? Math.min(x, most) : x), sums = integralsOf(table);
  const last = table.length / 4 - 1, means = new Float32Array(CODES * CODES);
  const entries = Int32Array.from({ length: CODES }, (_, code) => Math.round((code / (CODES - 1)) * last));
  for (let one = 0; one < CODES; one++) for (let other = 0; other < CODES; other++) {
    const from = entries[one], to = entries[other], sum = sums[4 * to + 3] - sums[4 * from + 3];
    means[CODES * one + other] = one === other ? table[4 * from + 3] : sum / (to - from);
  }
  return means;
}
