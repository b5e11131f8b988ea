// Which shares of a scene's light reach its surfels and its volume, found again where something of it has changed.

import { dot } from "./camera.js";
import { functionTables } from "./function_table.js";
import { EVERYWHERE, Matter, evenDirections, valueAt } from "./light_cells.js";
import { LAYERS, PLACED } from "./surfels.js";

// Cells along the longest side of a volume, and directions. For the sky they are fewer than texgs has: it is soft anyway.
const LAMP_SIDE = 128, SKY_SIDE = 64, SKY_DIRECTIONS = 32;
const STEP = 0.5, STEPS = 4; // cells, and how many of them to both sides of a surfel there is matter that belongs to it
const MEAN_SLANT = 1.5; // length of a ray by depth below a surface
const CLEAR = 1e-4; // share of light; matter that takes away less leaves a surfel where it is

/** Which shares of the light of a lamp and of that from all around matter takes away, at most; none of a headlight. */
export function strengthsOf({ can_shadow: can, shadows, occlusion }, light) {
  return can ? [light ? shadows : 0, occlusion] : [0, 0];
}

/** The latest value of a state: a list of things that are the same where they are equal. */
class Kept {
  #state = null; #value;

  of(state, make) {
    if (this.#state?.length === state.length && state.every((each, i) => each === this.#state[i])) return this.#value;
    [this.#state, this.#value] = [state, make()];
    return this.#value;
  }

  /** The value of whatever state, if there is one. */
  get latest() {
    return this.#value;
  }
}

export class VolumeLight {
  #samples; #facts;
  #matter = new Kept(); #lamp = new Kept(); #sky = new Kept();

  /**
   * @param {object} samples see samples.js.
   * @param {object} facts `volume` of the description of a scene.
   */
  constructor(samples, facts) {
    this.#samples = samples;
    this.#facts = facts;
  }

  /**
   * Cells of a scene's matter, and of what light of its lamp and of the sky reaches them, see `Matter`.
   *
   * @param {object} look `light`, a direction or null for a headlight, and `planes` that cut.
   * @param {boolean} isMoving then the sky may be that of before, which takes longest.
   */
  cells(scene, { light, planes }, isMoving) {
    const [shadows, occlusion] = strengthsOf(scene, light), { models, functions, reach } = scene;
    if (!shadows && !occlusion) return { extinctions: null, lamp: EVERYWHERE, sky: EVERYWHERE };
    const opacities = models.map(({ edit: { visible, opacity } }) => visible && opacity);
    const shown = JSON.stringify([opacities, functions, planes]), tables = () => functionTables(scene, this.#facts.channels);
    const matter = (longest) => new Matter(this.#samples, this.#facts, longest, tables(), planes);
    const opened = () => matter(SKY_SIDE).opened(reach, evenDirections(SKY_DIRECTIONS));
    const fine = this.#matter.of([shown], () => matter(LAMP_SIDE));
    return {
      extinctions: fine.extinctions,
      lamp: shadows ? this.#lamp.of([fine, ...light], () => fine.lit(light)) : EVERYWHERE,
      sky: !occlusion ? EVERYWHERE : isMoving && this.#sky.latest || this.#sky.of([shown, reach], opened),
    };
  }
}

/** Visibilities of the lamp as spherical harmonics, and of the sky, that a page holds of its surfels. */
export class Harmonics {
  #planes; #scales; #count;

  /**
   * @param {Map} tensors of the models, see texgs/viewer/page_light.py: NUMBER.exposure [10, N], differences of codes.
   * @param {number} models how many there are.
   * @param {number[][]} scales least value and step of each row.
   */
  constructor(tensors, models, scales) {
    const ofModels = Array.from({ length: models }, (_, number) => tensors.get(`${number}.exposure`));
    this.#scales = scales;
    this.#count = ofModels.reduce((sum, { shape }) => sum + shape[1], 0);
    this.#planes = scales.map((_, row) => {
      const plane = new Uint8Array(this.#count);
      let first = 0;
      for (const { shape: [, count], data } of ofModels) {
        plane.set(data.subarray(row * count, (row + 1) * count), first);
        for (let i = 1; i < count; i++) plane[first + i] += plane[first + i - 1];
        first += count;
      }
      return plane;
    });
  }

  /** Fills shares [N, 2] of a light, a direction or null. */
  fill(shares, light) {
    const [sky, ...rows] = this.#planes, terms = light ? harmonicsOf(light) : [];
    const steps = terms.map((term, k) => term * this.#scales[k + 1][1]);
    const begin = terms.reduce((sum, term, k) => sum + term * this.#scales[k + 1][0], 0);
    for (let i = 0; i < this.#count; i++) {
      let sum = begin;
      for (let k = 0; k < steps.length; k++) sum += steps[k] * rows[k][i];
      shares[2 * i] = Math.min(255, Math.max(0, 255 * sum + 0.5));
      shares[2 * i + 1] = sky[i];
    }
  }
}

/** Real spherical harmonics up to degree 2 at a direction, without their constants: see texgs/viewer/page_light.py. */
function harmonicsOf([x, y, z]) {
  return [1, x, y, z, x * y, y * z, z * x, x * x - y * y, 3 * z * z - 1];
}

export class SurfelLight {
  #surfels; #harmonics; #twin;
  #places = new Kept(); #shares = new Kept();

  /**
   * @param {object} surfels see surfels.js.
   * @param {Harmonics|null} harmonics of them.
   * @param {Twin|null} twin that knows the cells of a scene's light.
   */
  constructor(surfels, harmonics, twin) {
    this.#surfels = surfels;
    this.#harmonics = harmonics;
    this.#twin = twin;
  }

  /**
   * Which shares of the light reach the surfels of a scene.
   *
   * @returns {{strengths: number[], shares: Uint8Array|null}} shares [N, 2] in 255ths, another array where they differ.
   */
  of(scene, look, isMoving) {
    const strengths = strengthsOf(scene, look.light);
    if (strengths.every((each) => each === 0)) return { strengths, shares: null };
    const shares = this.#twin ? this.#inCells(this.#twin.cells(scene, look, isMoving), look.light)
      : this.#shares.of([...look.light ?? []], () => this.#make((to) => this.#harmonics.fill(to, look.light)));
    return { strengths, shares };
  }

  #inCells({ extinctions, lamp, sky }, light) {
    const places = this.#places.of([extinctions], () => placesOf(this.#surfels, extinctions));
    return this.#shares.of([places, lamp, sky, ...light ?? []], () => this.#make((to) => {
      fillFromCells(to, this.#surfels, places, { lamp, sky }, light);
    }));
  }

  #make(fill) {
    const shares = new Uint8Array(this.#surfels.lookups.length / 2);
    fill(shares);
    return shares;
  }
}

/**
 * Where rays from outside are absorbed near surfels, world units out of the surface, as texgs/scene/exposure.py has it.
 *
 * @returns {Float32Array} [N, 4]: one standard deviation before and behind the mean, for rays from the side of the
 *   normal, and for those from the other one.
 */
function placesOf({ count, surfels }, extinctions) {
  const places = new Float32Array(4 * count), met = new Float32Array(2 * STEPS + 1), step = STEP * extinctions.edge;
  const normals = surfels.subarray(PLACED.indexOf("normals") * surfels.length / LAYERS.length);
  for (let k = 0; k < 4 * count; k += 4) {
    const x = surfels[k], y = surfels[k + 1], z = surfels[k + 2], [a, b, c] = normalOf(normals, k);
    for (let i = -STEPS; i <= STEPS; i++) {
      const out = -i * step;
      met[i + STEPS] = MEAN_SLANT * step * valueAt(extinctions, x + out * a, y + out * b, z + out * c);
    }
    absorb(met, step, places, k);
    absorb(met.reverse(), step, places, k + 2);
  }
  return places;
}

/** Notes where a ray is absorbed that meets extinctions one step after the other. */
function absorb(met, step, places, k) {
  let through = 1, first = 0, second = 0, depth = 0;
  for (let i = 0; i < met.length; i++) {
    depth += met[i];
    const left = 2 ** -depth, weight = through - left, out = STEPS - i;
    first += weight * out;
    second += weight * out * out;
    through = left;
  }
  const taken = 1 - through;
  if (taken <= CLEAR) return;
  const mean = first / taken, spread = Math.sqrt(Math.max(0, second / taken - mean * mean));
  places[k] = step * (mean + spread);
  places[k + 1] = step * (mean - spread);
}

/** Fills shares of surfels: the lamp shines on the side that faces it, ambient light is that of the lighter side. */
function fillFromCells(shares, { count, surfels }, places, { lamp, sky }, light) {
  const normals = surfels.subarray(PLACED.indexOf("normals") * surfels.length / LAYERS.length);
  for (let k = 0, i = 0; k < 4 * count; k += 4, i += 2) {
    const normal = normalOf(normals, k), [a, b, c] = normal;
    const at = (cells, sign, near) => {
      const out = sign * (places[near] + cells.outset);
      return valueAt(cells, surfels[k] + out * a, surfels[k + 1] + out * b, surfels[k + 2] + out * c);
    };
    const mean = (cells, sign, near) => 0.5 * (at(cells, sign, near) + at(cells, sign, near + 1));
    const side = (cells, sign) => cells === EVERYWHERE ? 255 : mean(cells, sign, sign > 0 ? k : k + 2);
    shares[i] = 0.5 + (light ? side(lamp, dot(normal, light) > 0 ? 1 : -1) : 255);
    shares[i + 1] = 0.5 + Math.max(side(sky, 1), side(sky, -1));
  }
}

/** The third axis of a rotation by a quaternion w, x, y, z of any length. */
function normalOf(quats, k) {
  const w = quats[k], x = quats[k + 1], y = quats[k + 2], z = quats[k + 3], scale = 2 / (w * w + x * x + y * y + z * z);
  return [scale * (x * z + w * y), scale * (y * z - w * x), 1 - scale * (x * x + y * y)];
}
