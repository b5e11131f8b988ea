// What a link says of a scene, checked as the server does it: what cannot be used is left out, and named.

import { timesOf } from "./state.js";

const MOST = 1e6; // of a coordinate
const MOST_FACTOR = 1000, MOST_PLANES = 6, MOST_REACH = 2, MOST_MARKERS = 100, MOST_LETTERS = 200;

/** A number between two others; nothing else. */
const isNumber = (x, low = -MOST, high = MOST) => typeof x === "number" && x >= low && x <= high;
const areThree = (x, low, high) => Array.isArray(x) && x.length === 3 && x.every((each) => isNumber(each, low, high));
const isColor = (x) => areThree(x, 0, 1);
const isFactor = (x) => isNumber(x, 0, MOST_FACTOR);
const isPlane = (x) => areThree(x?.normal) && Math.hypot(...x.normal) >= 1 / MOST && isNumber(x.offset);
const isWindow = (x) => Array.isArray(x) && x.length === 2 && x.every(Number.isFinite) && x[0] < x[1];
const isBox = (x) => areThree(x?.low) && areThree(x?.high) && x.low.every((low, i) => low < x.high[i]);
const arePoints = (x, columns, least) => Array.isArray(x) && x.length >= least && x.every((row, i) =>
  Array.isArray(row) && row.length === columns && Number.isFinite(row[0]) && !(row[0] < x[i - 1]?.[0])
  && row.slice(1).every((each) => isNumber(each, 0, 1)));
const isMarker = (x) => Array.isArray(x?.points) && [1, 2].includes(x.points.length)
  && x.points.every((point) => areThree(point)) && typeof x.text === "string" && x.text.length <= MOST_LETTERS;
const isFunction = (x) => arePoints(x?.opacity, 2, 2) && arePoints(x?.color, 4, 1);
const isShare = (x, scene) => scene.can_shadow && isNumber(x, 0, 1);
const OF_PART = {
  visible: (x) => typeof x === "boolean", palette: isColor, opacity: isFactor,
  ambient: isFactor, diffuse: isFactor, specular: isFactor, shininess: isFactor, tint: isColor,
};
const OF_SCENE = {
  light: (x) => isNumber(x?.azimuth) && isNumber(x?.polar),
  shadows: isShare, occlusion: isShare, reach: (x, scene) => scene.can_shadow && isNumber(x, 1 / MOST, MOST_REACH),
  background: isColor,
  cuts: (x) => Array.isArray(x?.planes) && x.planes.length <= MOST_PLANES && x.planes.every(isPlane)
    && (x.box === null || isBox(x.box)) && ["shaded", "unlit", "slice"].includes(x.faces)
    && (x.window === undefined || isWindow(x.window)),
  functions: (x, scene) => Boolean(scene.transfer) && typeof x === "object" && !Array.isArray(x)
    && Object.values(x).every(isFunction),
  markers: (x) => Array.isArray(x) && x.length <= MOST_MARKERS && x.every(isMarker),
  time: (x, scene) => timesOf(scene).includes(x),
};

function isUsable(scene, { part, key, value }) {
  const isPartOf = ({ name, segments }) =>
    name === part || segments.some((each) => `${name}/${each.name}` === part);
  const known = part === "" ? Object.keys(OF_SCENE) : scene.models.find(isPartOf)?.can ?? [];
  const check = known.includes(key) && (part === "" ? OF_SCENE : OF_PART)[key];
  const isReset = (value ?? null) === null && key !== "time"; // a step is always shown
  return Boolean(check) && (isReset || check(value, scene));
}

/** Edits in a link that a scene can have; the names of others are added to `wrong`. */
export function editsOf(text, scene, wrong) {
  let edits = null;
  try {
    edits = JSON.parse(text ?? "[]");
  } catch {
    // it is none
  }
  if (!Array.isArray(edits)) wrong.push("edits");
  return Array.isArray(edits) ? edits.filter((each) => {
    const isGood = isUsable(scene, each ?? {});
    if (!isGood) wrong.push([each?.part, each?.key].filter(Boolean).join(" ") || "an edit");
    return isGood;
  }) : [];
}

/** So many numbers by commas; undefined where a text is none. */
export function numbersIn(text, count) {
  const numbers = text.split(",").map((each) => each.trim() ? Number(each) : NaN);
  return numbers.length === count && numbers.every((each) => isNumber(each)) ? numbers : undefined;
}

/** The same of a link, by a key; where there is one and it is none, it is added to `wrong`. */
export function numbersOf(words, key, count, wrong) {
  if (!words.has(key)) return undefined;
  const numbers = numbersIn(words.get(key), count);
  if (!numbers) wrong.push(key);
  return numbers;
}
