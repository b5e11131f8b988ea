// Surfels of all models, laid out as the textures that the shaders read.

export const WIDTH = 2048; // texels in a row of every texture; WebGL2 always has so many
export const LAYERS = ["place", "quats", "scales", "colors", "material"]; // of 4 floats; place: mean and opacity
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
  for (const model of models) {
    LAYERS.forEach((name, k) => model[name](surfels.subarray(k * layer + 4 * first)));
    fillLookups(lookups.subarray(4 * first), model, firstTexel);
    first += model.count;
    firstTexel += model.texels.length / 3;
  }
  return { count, surfels, lookups, texels: joinTexels(models) };
}

/** `length` made whole rows of WIDTH texels with so many channels each. */
function padded(length, channels) {
  const row = WIDTH * channels;
  return Math.max(1, Math.ceil(length / row)) * row;
}

/** One model: how it fills each layer, and its texels. */
function readModel(tensors, number, optics, row) {
  const of = (name) => tensors.get(`${number}.${name}`)?.data;
  const [count] = tensors.get(`${number}.means`).shape;
  const [means, opacities, scales, material] = [of("means"), of("opacities"), of("scales"), materialOf(of, optics)];
  return {
    count,
    row,
    labels: of("labels"),
    sizes: of("sizes"),
    texels: texelsOf(tensors.get(`${number}.codes`)),
    place: (to) => {
      fill(to, means, count, 3);
      for (let i = 0; i < count; i++) to[4 * i + 3] = sigmoid(opacities[i]);
    },
    quats: (to) => fill(to, of("quats"), count, 4),
    scales: (to) => fill(to, scales.map(Math.exp), count, 2),
    colors: (to) => fill(to, of("colors"), count, 3),
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

/** Texels [T, 3] in steps, from the planes of bytes of a compact file; one of 0 for a model without texture. */
function texelsOf(codes) {
  if (!codes) return new Int16Array(3);
  const [planes, , count] = codes.shape;
  const texels = new Int16Array(3 * count);
  const step = (channel, i) => {
    let signed = 0;
    for (let k = 0; k < planes; k++) signed |= codes.data[(3 * k + channel) * count + i] << (8 * k);
    return (signed >>> 1) ^ -(signed & 1);
  };
  for (let i = 0; i < count; i++) {
    const green = step(0, i);
    texels[3 * i] = green + step(1, i);
    texels[3 * i + 1] = green;
    texels[3 * i + 2] = green + step(2, i);
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
