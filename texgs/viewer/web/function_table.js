// What a scene shows of its volume, as tables over the values: colours, and extinctions of its functions together.

import { at } from "./functions.js";

export const SIZE = 4096; // entries, sixteen for each code of a sample
const MOST = 20; // extinction of what is opaque; of more, sums in single precision would lose what is faint
export const HALF = 127.5; // value of a mask from which on a place is of its label, as in texgs/volume/label_masks.py
const clamp = (x) => Math.min(1, Math.max(0, x));

/**
 * What functions of a scene are functions of, visible or not: a channel, as a whole or within a mask.
 *
 * @param {object} scene description with its edits.
 * @param {object[]} channels of the page, see texgs/viewer/page_volume.py; functions of others are left out.
 * @returns {{key: string, channel: number, mask: number, half: number}[]} places among the channels, a mask of -1 where
 *   there is none, and the share of its codes from which on a place counts.
 */
export function sourcesOf({ tfs, functions }, channels) {
  const all = Object.values({ ...tfs, ...functions }).map((tf) => sourceOf(tf, channels)).filter(Boolean);
  const sources = new Map(all.map((each) => [each.key, each]));
  return sources.size ? [...sources.values()] : [sourceOf({}, channels)];
}

/** The same with the `table` of each of them. */
export function functionTables(scene, channels) {
  return sourcesOf(scene, channels).map((source) => {
    const counts = (tf) => sourceOf(tf, channels)?.key === source.key;
    return { ...source, table: functionTable(scene, counts, channels[source.channel]) };
  });
}

function sourceOf({ channel: number = 0, within }, channels) {
  const channel = placeOf(number, channels), mask = within === undefined ? -1 : placeOf(within, channels);
  if (channel < 0 || (within !== undefined && mask < 0)) return undefined;
  return { key: `${channel} ${mask}`, channel, mask, half: mask < 0 ? 0 : halfOf(channels[mask]) };
}

/** The place of a channel of the volume among those of the page, by its number; -1 where the page has not that. */
export function placeOf(number = 0, channels) {
  return channels.findIndex((each) => each.number === number);
}

/** The share of the codes of a mask from which on a place is of its label. */
export function halfOf({ low, high }) {
  return (HALF - low) / (high - low);
}

/**
 * The table [SIZE, 4] of red, green, blue and extinction, log2 of the light that passes through a unit of length.
 * Where functions overlap, extinctions add up, and colours are means that these weigh.
 *
 * @param {object} scene description with its edits.
 * @param {(tf: object) => boolean} counts which of its functions.
 * @param {{low: number, high: number}} range of the values.
 * @returns {Float32Array}
 */
function functionTable(scene, counts, { low, high }) {
  const shown = shownOf(scene).filter(({ tf }) => counts(tf)), table = new Float32Array(4 * SIZE);
  for (let i = 0, k = 0; i < SIZE; i++, k += 4) {
    const value = low + (high - low) * i / (SIZE - 1);
    for (const { tf, factor, colorAt } of shown) {
      const extinction = Math.min(MOST, -Math.log2(1 - clamp(factor * opacityAt(tf, value))));
      if (!(extinction > 0)) continue;
      colorAt(value).forEach((x, c) => { table[k + c] += extinction * x; });
      table[k + 3] += extinction;
    }
    for (let c = 0; c < 3 && table[k + 3] > 0; c++) table[k + c] /= table[k + 3];
  }
  return table;
}

/** Integrals of a table over its entries up to each: of extinction, and of colours that it weighs. */
export function integralsOf(table) {
  const sums = new Float32Array(table.length), running = [0, 0, 0, 0];
  const weighed = (k, c) => c < 3 ? table[k + c] * table[k + 3] : table[k + 3];
  for (let k = 4; k < table.length; k += 4) {
    for (let c = 0; c < 4; c++) {
      running[c] += (weighed(k - 4, c) + weighed(k, c)) / 2;
      sums[k + c] = running[c];
    }
  }
  return sums;
}

/** Functions that are visible, each with the factor of its opacity and the colours at its values, as edits move them. */
export function shownOf({ models, functions, tfs }) {
  const made = (name, tf, factor, moved) =>
    ({ name, tf, factor, colorAt: (value) => at(tf.color, value).map((x, c) => clamp(x + moved[c])) });
  const ofModels = models.filter(({ edit }) => edit.visible && edit.opacity > 0)
    .map(({ name, edit: { opacity, palette }, fitted_palette: fitted }) =>
      made(name, functions[name] ?? tfs[name], opacity, palette ? palette.map((x, c) => x - fitted[c]) : [0, 0, 0]));
  const names = models.map(({ name }) => name);
  const others = Object.entries(functions).filter(([name]) => !names.includes(name));
  return [...ofModels, ...others.map(([name, tf]) => made(name, tf, 1, [0, 0, 0]))];
}

/** Outside its points a function shows nothing. */
function opacityAt({ opacity }, value) {
  return value < opacity[0][0] || value > opacity.at(-1)[0] ? 0 : at(opacity, value)[0];
}

/** Factors of light and the tint of highlights for the whole volume: those of the first visible model. */
export function materialOf({ models }, appearance) {
  const { edit } = models.find((model) => model.edit.visible && model.edit.opacity > 0) ?? { edit: {} };
  const factors = ["ambient", "diffuse", "specular", "shininess"].map((key) => appearance[key] * (edit[key] ?? 1));
  return { factors, tint: edit.tint ?? [1, 1, 1] };
}
