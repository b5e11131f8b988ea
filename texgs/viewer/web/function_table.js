// What a scene shows of its volume, as a table over the values: colours, and extinctions of its functions together.

import { at } from "./functions.js";

export const SIZE = 4096; // entries, sixteen for each code of a sample
const MOST = 20; // extinction of what is opaque; of more, sums in single precision would lose what is faint
const clamp = (x) => Math.min(1, Math.max(0, x));

/**
 * The table [SIZE, 4] of red, green, blue and extinction, log2 of the light that passes through a unit of length.
 * Where functions overlap, extinctions add up, and colours are means that these weigh.
 *
 * @param {object} scene description with its edits.
 * @param {{low: number, high: number}} range of the values.
 * @returns {Float32Array}
 */
export function functionTable(scene, { low, high }) {
  const shown = shownOf(scene), table = new Float32Array(4 * SIZE);
  for (let i = 0, k = 0; i < SIZE; i++, k += 4) {
    const value = low + (high - low) * i / (SIZE - 1);
    for (const { tf, factor, moved } of shown) {
      const extinction = Math.min(MOST, -Math.log2(1 - clamp(factor * opacityAt(tf, value))));
      if (!(extinction > 0)) continue;
      at(tf.color, value).forEach((x, c) => { table[k + c] += extinction * clamp(x + moved[c]); });
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

/** Functions that are visible, each with the factor of its opacity and by how much its colours are moved. */
function shownOf({ models, functions, tfs }) {
  const ofModels = models.filter(({ edit }) => edit.visible && edit.opacity > 0)
    .map(({ name, edit: { opacity, palette }, fitted_palette: fitted }) => ({
      tf: functions[name] ?? tfs[name], factor: opacity,
      moved: palette ? palette.map((x, c) => x - fitted[c]) : [0, 0, 0],
    }));
  const names = models.map(({ name }) => name);
  const others = Object.entries(functions).filter(([name]) => !names.includes(name));
  return [...ofModels, ...others.map(([, tf]) => ({ tf, factor: 1, moved: [0, 0, 0] }))];
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
