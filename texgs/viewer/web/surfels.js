// Surfels of all models, laid out as the textures that the shaders read.

import { wholeNumbers } from "./tensors.js";

export const WIDTH = 2048; // texels in a row of every texture; WebGL2 always has so many
export const PLACED = ["place", "quats", "scales", "colors", "normals"]; // layers of 4 floats that change in time; place: mean and opacity
export const LAYERS = [...PLACED, "material"];
const SHININESS = [1, 100]; // range of the bounded exponent

const sigmoid = (x) => 1 / (1 + Math.exp(-x));

/**
 * Joins the tensors of models, named NUMBER.PARAMETER and otherwise as in compact model files.
 *
 * @param {Map} tensors see tensors.js.
 * @param {object[]} optics of each model; of it, `material` says how raw material becomes factors.
 * @param {number[]} rows first row of each model in the table of parts; those of its segments follow.
 * @returns {object} `count`; `surfels` [LAYERS, height, WIDTH, 4] float; `lookups` [height, WIDTH, 4] uint: first
 *   texel, texels along u and along v, row of the part; `texels` [T, 3] in steps.
 */
export function joinSurfels(tensors, optics, rows) {
  const models = optics.map((each, number) => readModel(tensors, number, each, rows[number]));
  const count = models.reduce((sum, model) => sum + model.count, 0);
  const layer = padded(4 * count, 4);
  const surfels = new Float32Array(LAYERS.length * layer);
  const lookups = new Uint32Array(layer);
  let first = 0;
  let firstTexel = 0;
  placeSurfels(surfels, tensors, models.length);
  for (const model of models) {
    model.material(surfels.subarray(PLACED.length * layer + 4 * first));
    fillLookups(lookups.subarray(4 * first), model, firstTexel);
    first += model.count;
    firstTexel += model.texels.length / 3;
  }
  return { count, surfels, lookups, texels: joinTexels(models) };
}

/** Fills the layers that change in time. */
export function placeSurfels(surfels, tensors, models) {
  const layer = surfels.length / LAYERS.length;
  let first = 0;
  for (let number = 0; number < models; number++) {
    const of = (name) => tensors.get(`${number}.${name}`)?.data, count = of("opacities").length;
    const [place, quats, scales, colors, normals] = PLACED.map((_, k) => surfels.subarray(k * layer + 4 * first));
    fill(place, of("means"), count, 3);
    of("opacities").forEach((opacity, i) => { place[4 * i + 3] = sigmoid(opacity); });
    fill(quats, of("quats"), count, 4);
    fill(scales, of("scales").map(Math.exp), count, 2);
    fill(colors, of("colors"), count, 3);
    fill(normals, of("normals") ?? of("quats"), count, 4);
    first += count;
  }
}

/** `length` made whole rows of WIDTH texels with so many channels each. */
function padded(length, channels) {
  const row = WIDTH * channels;
  return Math.max(1, Math.ceil(length / row)) * row;
}

/** One model: how it fills the layer of its material, and its texels. */
function readModel(tensors, number, optics, row) {
  const of = (name) => tensors.get(`${number}.${name}`)?.data;
  const [count] = tensors.get(`${number}.means`).shape;
  const material = materialOf(of, optics);
  return {
    count,
    row,
    labels: of("labels"),
    sizes: of("sizes"),
    texels: texelsOf(tensors.get(`${number}.codes`)),
    material: (to) => material.forEach((factor, k) => {
      for (let i = 0; i < count; i++) to[4 * i + k] = factor[factor.length === 1 ? 0 : i];
    }),
  };
}

/** Copies rows of `columns` values to the beginnings of rows of 4. */
function fill(to, from, count, columns) {
  for (let i = 0; i < count; i++) {
    for (let k = 0; k < columns; k++) to[4 * i + k] = from[columns * i + k];
  }
}

/** Factors k_a, k_d, k_s and exponent from raw material, as texgs/fields/surfels/shading.py has them. */
function materialOf(of, optics) {
  const [ambient, diffuse, specular, shininess] = ["ambient", "diffuse", "specular", "shininess"].map(of);
  if (optics.material === "paper") {
    return [ambient, diffuse, specular.map((x) => 5 * sigmoid(x)), shininess.map((x) => 50 * sigmoid(x))];
  }
  const [low, high] = SHININESS;
  const bounded = shininess.map((x) => low + (high - low) * sigmoid(x));
  return [ambient.map(sigmoid), diffuse.map(sigmoid), specular.map(sigmoid), bounded];
}

/** Texels [T, 3] in steps, from the codes of a compact file; one of 0 for a model without texture. */
function texelsOf(codes) {
  if (!codes) return new Int16Array(3);
  const [green, red, blue] = wholeNumbers(codes), texels = new Int16Array(3 * green.length);
  for (let i = 0, k = 0; i < green.length; i++) {
    texels[k++] = green[i] + red[i];
    texels[k++] = green[i];
    texels[k++] = green[i] + blue[i];
  }
  return texels;
}

/** Where the texels of each surfel begin, how many there are along u and v, and the row of its part. */
function fillLookups(lookups, model, firstTexel) {
  let begin = firstTexel;
  for (let i = 0; i < model.count; i++) {
    const [columns, rows] = model.sizes ? [model.sizes[2 * i], model.sizes[2 * i + 1]] : [1, 1];
    lookups.set([begin, columns, rows, model.row + (model.labels ? model.labels[i] : 0)], 4 * i);
    if (model.sizes) begin += columns * rows;
  }
}

/** Texels of all models one after the other, in whole rows: of 8 bits where those suffice. */
function joinTexels(models) {
  const total = models.reduce((sum, model) => sum + model.texels.length, 0);
  const fits = models.every((model) => model.texels.every((x) => x >= -128 && x <= 127));
  const joined = new (fits ? Int8Array : Int16Array)(padded(total, 3));
  let begin = 0;
  for (const model of models) {
    joined.set(model.texels, begin);
    begin += model.texels.length;
  }
  return joined;
}
