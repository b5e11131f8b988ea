// Places in the space of the volume's file, such as that of a patient.

import { dot } from "./camera.js";

const ALONG = 0.9999; // cosine from which on a normal runs along an axis

/** Where a plane lies, in words: along the axis that its normal runs along, else where it is held. */
export function placeOf({ axes, unit, matrix, scale }, normal, point) {
  const rows = matrix.slice(0, 3);
  const words = rows.map((row, i) => `${axes[i]} ${Number((dot(row, point) + row[3]).toPrecision(5))}`);
  const axis = rows.findIndex((row) => Math.abs(dot(row, normal)) > ALONG * scale);
  return `${axis < 0 ? words.join(", ") : words[axis]} ${unit}`.trim();
}
