// Transfer functions as numbers: {opacity: [[value, opacity], ...], color: [[value, r, g, b], ...]}, piecewise linear.
// What is edited here is a new one; values stay ascending, and channels in [0, 1].

const LEAST = { opacity: 2, color: 1 }; // points
const clamp = (x, low, high) => Math.min(high, Math.max(low, x));

/** The channels at a value; those of the nearest point outside. */
export function at(points, value) {
  const after = points.findIndex((point) => point[0] > value);
  if (after === -1) return points.at(-1).slice(1);
  if (after === 0) return points[0].slice(1);
  const [one, other] = [points[after - 1], points[after]], t = (value - one[0]) / (other[0] - one[0]);
  return one.slice(1).map((x, i) => (1 - t) * x + t * other[i + 1]);
}

/** A point at another value, between its neighbours, with other channels. */
export function moved(tf, key, index, value, channels, [low, high]) {
  const points = tf[key], gap = (high - low) / 1e4;
  const least = index ? Math.min(points[index - 1][0] + gap, points[index][0]) : low;
  const most = index < points.length - 1 ? Math.max(points[index + 1][0] - gap, points[index][0]) : high;
  const point = [clamp(value, Math.min(least, most), most), ...channels.map((x) => clamp(x, 0, 1))];
  const changed = { ...tf, [key]: points.with(index, point) }, { opacity, color } = changed;
  if (key === "opacity" && color.length === 1) { // the only colour stays where something is seen
    const [[at, ...rgb]] = color;
    changed.color = [[clamp(at, opacity[0][0], opacity.at(-1)[0]), ...rgb]];
  }
  return isVisible(changed) ? changed : tf;
}

/** One more point, on the line or where it is given; and its index. */
export function added(tf, key, value, channels = at(tf[key], value)) {
  const points = tf[key], before = points.findIndex((point) => point[0] > value);
  const index = before === -1 ? points.length : before;
  return [{ ...tf, [key]: points.toSpliced(index, 0, [value, ...channels]) }, index];
}

/** Without a point, as long as enough are left to see something. */
export function removed(tf, key, index) {
  const changed = { ...tf, [key]: tf[key].toSpliced(index, 1) };
  return changed[key].length >= LEAST[key] && isVisible(changed) ? changed : tf;
}

/** The whole function at other values; it stops at the ends of the range. */
export function shifted(tf, by, [low, high]) {
  const values = tf.opacity.map(([value]) => value);
  const step = clamp(by, Math.min(0, low - values[0]), Math.max(0, high - values.at(-1)));
  const shift = (points) => points.map(([value, ...channels]) => [value + step, ...channels]);
  return { ...tf, opacity: shift(tf.opacity), color: shift(tf.color) };
}

/** A peak in the middle of a range. */
export function fresh([low, high], color) {
  const value = (share) => low + share * (high - low);
  return { opacity: [[value(0.4), 0], [value(0.5), 0.5], [value(0.6), 0]], color: [[value(0.5), ...color]] };
}

/** The colours of a preset, [[share, r, g, b], ...], over the range that is visible. */
export function colored(tf, preset) {
  const low = tf.opacity[0][0], high = tf.opacity.at(-1)[0];
  return { ...tf, color: preset.map(([share, ...rgb]) => [low + share * (high - low), ...rgb]) };
}

/** The mean colour, which buttons and lines have. */
export function meanColor({ color }) {
  return [1, 2, 3].map((i) => color.reduce((sum, point) => sum + point[i], 0) / color.length);
}

/** A name that is not there yet. */
export function newName(names) {
  let number = names.length + 1;
  const name = () => `TF${String(number).padStart(2, "0")}`;
  while (names.includes(name())) number += 1;
  return name();
}

/** Whether it shows any value. */
function isVisible({ opacity }) {
  return opacity.some(([value, alpha], i) =>
    alpha > 0 && (opacity[i - 1]?.[0] < value || value < opacity[i + 1]?.[0]));
}
