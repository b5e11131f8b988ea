// Places in the space of the volume's file, such as that of a patient.

import { dot } from "./camera.js";

const ALONG = 0.9999; // cosine from which on a normal runs along an axis

/** Where a plane lies, in words: along the axis that its normal runs along, else where it is held. */
export function placeOf({ axes, unit, matrix, scale }, normal, point) {
  const rows = matrix.slice(0, 3);
  const words = inFile(point, { matrix }).map((x, i) => `${axes[i]} ${Number(x.toPrecision(5))}`);
  const axis = rows.findIndex((row) => Math.abs(dot(row, normal)) > ALONG * scale);
  return `${axis < 0 ? words.join(", ") : words[axis]} ${unit}`.trim();
}

/** The length of a distance in words, in the unit of the volume's file where it is known; "" of a point. */
export function lengthOf({ points }, space) {
  if (points.length < 2) return "";
  const length = Math.hypot(...points[0].map((x, i) => x - points[1][i])) * (space?.scale ?? 1);
  const unit = space ? space.unit || "volume units" : "world units";
  return `${length < 1000 ? Number(length.toPrecision(3)) : Math.round(length)} ${unit}`;
}

/** A point of the world in the space of the volume's file, if it has one. */
export const inFile = (point, space) => space
  ? space.matrix.slice(0, 3).map((row) => dot(row, point) + row[3]) : point;
