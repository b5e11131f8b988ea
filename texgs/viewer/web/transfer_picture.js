// The histogram of a volume with transfer functions over it, the colours of one of them below.

import { at, meanColor } from "./functions.js";
import { toHex } from "./inputs.js";

const WIDTH = 300, HEIGHT = 100, STRIP = 14, GAP = 8; // units of the drawing
const RADIUS = 4.5; // of points
const MARGIN = 6;
const CURVE = 6; // pieces of a line between two points
const rise = Math.sqrt, opacityAt = (height) => height ** 2; // faint matter has opacities of a few hundredths
const short = (value) => String(Number(value.toPrecision(4)));
const drawn = (tag, attributes) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
};

export class TransferPicture {
  svg; range; // of the values that are drawn
  #volume;

  /** @param {{minimum: number, maximum: number, histogram: number[]}} volume */
  constructor(volume) {
    this.#volume = volume;
    const size = [-MARGIN, -MARGIN, WIDTH + 2 * MARGIN, HEIGHT + GAP + STRIP + 2 * MARGIN];
    this.svg = drawn("svg", { viewBox: size.join(" ") });
  }

  /** Choose the range of the values: those of the volume and of all functions. */
  fit(all) {
    const ends = Object.values(all).flatMap(({ opacity }) => [opacity[0][0], opacity.at(-1)[0]]);
    const low = Math.min(this.#volume.minimum, ...ends), high = Math.max(this.#volume.maximum, ...ends);
    this.range = [low, high > low ? high : low + 1];
  }

  /** Draw functions by name, and points of the one of this name, of which one is chosen. */
  draw(all, name, chosen) {
    const focused = this.svg.contains(document.activeElement) ? document.activeElement.dataset : null;
    const others = Object.entries(all).filter(([each]) => each !== name), points = (key) => this.#points(all[name], name, key, chosen);
    this.svg.replaceChildren(
      drawn("path", { class: "histogram", d: area(this.#heights()) }),
      ...others.map(([each, tf]) => this.#shape(each, tf, "function")), this.#shape(name, all[name], "function edited"),
      ...this.#strip(all[name]), ...points("color"), ...points("opacity"));
    if (focused) this.focus(focused);
  }

  /** Focus a point. */
  focus({ key, index }) {
    this.svg.querySelector(`circle[data-key="${key}"][data-index="${index}"]`)?.focus();
  }

  /** Value, opacity and whether it is on the colours, below a pointer; and what is drawn there. */
  below({ clientX, clientY }) {
    const [low, high] = this.range;
    const { x, y } = new DOMPoint(clientX, clientY).matrixTransform(this.svg.getScreenCTM().inverse());
    const value = low + (high - low) * Math.min(1, Math.max(0, x / WIDTH));
    return { value, alpha: opacityAt(Math.min(1, Math.max(0, 1 - y / HEIGHT))), isOnColors: y > HEIGHT,
      drawn: document.elementFromPoint(clientX, clientY)?.dataset ?? {} };
  }

  /** A value, and how much of the volume has about it; the range where there is none. */
  words(value) {
    if (value === undefined) return `${short(this.range[0])} to ${short(this.range[1])}`;
    const { minimum, maximum, histogram } = this.#volume;
    if (!histogram.length) return short(value);
    const sum = histogram.reduce((a, b) => a + b, 0);
    const bin = Math.floor((value - minimum) / (maximum - minimum) * histogram.length);
    const count = histogram[value === maximum ? histogram.length - 1 : bin];
    return `${short(value)}: ${count ? `${short(100 * count / sum)} % of the volume` : "not in the volume"}`;
  }

  #x(value) {
    const [low, high] = this.range;
    return WIDTH * (value - low) / (high - low);
  }

  /** Heights in [0, 1] of counts on a logarithmic scale, as corners of steps. */
  #heights() {
    const { minimum, maximum, histogram } = this.#volume, most = Math.log1p(Math.max(...histogram, 1));
    const width = (maximum - minimum) / histogram.length;
    return [[this.#x(minimum), 0], ...histogram.flatMap((count, bin) => [0, 1].map((end) =>
      [this.#x(minimum + (bin + end) * width), Math.log1p(count) / most]))];
  }

  #shape(name, tf, state) {
    const color = toHex(meanColor(tf)), d = area(curve(tf.opacity).map(([value, alpha]) => [this.#x(value), rise(alpha)]));
    const shape = drawn("path", { d, fill: color, stroke: color, class: state });
    shape.dataset.name = name;
    return shape;
  }

  #strip({ opacity, color }) {
    const low = this.#x(opacity[0][0]), high = this.#x(opacity.at(-1)[0]);
    const gradient = drawn("linearGradient", { id: "colors", gradientUnits: "userSpaceOnUse", x1: 0, x2: WIDTH });
    gradient.append(...color.map(([value, ...rgb]) =>
      drawn("stop", { offset: Math.min(1, Math.max(0, this.#x(value) / WIDTH)), "stop-color": toHex(rgb) })));
    const bar = { class: "strip", x: low, y: HEIGHT + GAP, width: Math.max(high - low, 1), height: STRIP };
    return [gradient, drawn("rect", { ...bar, fill: "url(#colors)" })];
  }

  #points(tf, name, key, chosen) {
    const what = key === "opacity" ? "Point" : "Colour";
    return tf[key].map(([value, ...channels], index) => {
      const y = key === "opacity" ? HEIGHT * (1 - rise(channels[0])) : HEIGHT + GAP + STRIP / 2;
      const fill = toHex(key === "color" ? channels : at(tf.color, value));
      const state = key === chosen.key && index === chosen.index ? "chosen" : "";
      const circle = drawn("circle", { cx: this.#x(value), cy: y, r: RADIUS, fill, class: state, tabindex: 0,
        role: "slider", "aria-label": `${what} ${index + 1} of ${name}`,
        "aria-valuemin": this.range[0], "aria-valuemax": this.range[1], "aria-valuenow": value });
      Object.assign(circle.dataset, { key, index });
      return circle;
    });
  }
}

/** More points on the lines between points. */
function curve(points) {
  return points.flatMap((point, i) => Array.from({ length: i ? CURVE : 1 }, (_, k) => {
    const t = (k + 1) / CURVE;
    return i ? point.map((x, j) => (1 - t) * points[i - 1][j] + t * x) : point;
  }));
}

/** The area below a line of x and heights in [0, 1] as a path. */
function area(points) {
  const place = ([x, height]) => `${x.toFixed(2)},${(HEIGHT * (1 - height)).toFixed(2)}`;
  const [first, last] = [points[0][0], points.at(-1)[0]];
  return `M${first.toFixed(2)},${HEIGHT} L${points.map(place).join(" ")} L${last.toFixed(2)},${HEIGHT} Z`;
}
