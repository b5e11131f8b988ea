// The histogram of the volume with the transfer functions of the models over it; pointing at one shows it alone.

import { element, toHex } from "./inputs.js";

const WIDTH = 300, HEIGHT = 90; // units of the drawing
const drawn = (tag, attributes) => {
  const made = document.createElementNS("http://www.w3.org/2000/svg", tag);
  for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
  return made;
};

/** Draw them into a place. */
export class TransferPanel {
  #show;

  /**
   * @param {Element} place
   * @param {{minimum: number, maximum: number, histogram: number[], functions: object[]}} transfer
   * @param {(model: string) => void} show - a model alone, or all for ""
   */
  constructor(place, { minimum, maximum, histogram, functions }, show) {
    this.#show = show;
    const ends = functions.flatMap(({ opacity }) => [opacity[0][0], opacity.at(-1)[0]]);
    const low = Math.min(minimum, ...ends), high = Math.max(maximum, ...ends), range = high - low || 1;
    const x = (value) => WIDTH * (value - low) / range;
    const picture = drawn("svg", { viewBox: `0 0 ${WIDTH} ${HEIGHT}`, "aria-hidden": "true" });
    picture.append(drawn("path", { class: "histogram", d: area(counts(histogram, x, minimum, maximum)) }));
    for (const { model, opacity, color } of functions) {
      const d = area(opacity.map(([value, alpha]) => [x(value), alpha]));
      const shape = drawn("path", { d, fill: toHex(color), stroke: toHex(color), class: "function" });
      this.#react(shape, model);
      picture.append(shape);
    }
    const names = functions.map(({ model, color }) => {
      const button = element("button", { type: "button", title: `Show ${model} alone while pointed at` },
        element("span", { className: "swatch" }), model);
      button.firstChild.style.background = toHex(color);
      this.#react(button, model);
      return button;
    });
    const label = (value) => element("span", {}, String(Number(value.toPrecision(4))));
    place.replaceChildren(picture, element("div", { className: "ends" }, label(low), label(high)),
      element("div", { className: "names" }, ...names));
  }

  #react(target, model) {
    for (const event of ["pointerenter", "focus"]) target.addEventListener(event, () => this.#show(model));
    for (const event of ["pointerleave", "blur"]) target.addEventListener(event, () => this.#show(""));
  }
}

/** Heights in [0, 1] of counts on a logarithmic scale, as corners of steps. */
function counts(histogram, x, minimum, maximum) {
  const most = Math.log1p(Math.max(...histogram, 1)), width = (maximum - minimum) / histogram.length;
  return histogram.flatMap((count, bin) => {
    const height = Math.log1p(count) / most;
    return [[x(minimum + bin * width), height], [x(minimum + (bin + 1) * width), height]];
  });
}

/** The area below a line as a path. */
function area(points) {
  const at = ([x, height]) => `${x.toFixed(2)},${(HEIGHT * (1 - height)).toFixed(2)}`;
  const [first, last] = [points[0][0], points.at(-1)[0]];
  return `M${first.toFixed(2)},${HEIGHT} L${points.map(at).join(" ")} L${last.toFixed(2)},${HEIGHT} Z`;
}
