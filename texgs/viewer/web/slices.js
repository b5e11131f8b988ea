// Slices of the scene's volume along the axes of its file, beside the scene: a crosshair that all three show, a window
// of values from black to white, and what is at the crosshair.

import { element } from "./inputs.js";
import { SliceLattice } from "./slice_lattice.js";
import { SliceView } from "./slice_view.js";

const FULL_DRAG = 300; // CSS pixels that move a window by its width, or make it e times as wide
const NARROWEST = 1e-6; // of the first window
const DIGITS = 6; // of values, of which most are stored in 32 bits
const get = (id) => document.getElementById(id);

export class Slices extends EventTarget {
  active = 2; // number of the plane that was used last
  #whole; #space; #views; #place; #ends;
  #told = 0; // counts places that were asked for

  /**
   * Dispatches "move" when the crosshair, the active plane or the window is another, "click" when it was put somewhere
   * by a click, and "open" when slices are shown or hidden.
   *
   * @param {{planes: object[], window: number[], slice: Function, place: Function}} source - of samples:
   *   `slice(plane, number, window)` is a promise of an ImageBitmap or ImageData, a pixel a sample, row 0 at the top;
   *   `place(point)` of {index, position, value, labels}, or null beyond the volume, and the value null where
   *   there are labels alone; `window` has the values from black to white to begin with
   * @param {{axes: string, unit: string}} space - of positions
   * @param {(text: string) => void} tell - what went wrong
   */
  constructor(source, space, tell) {
    super();
    this.source = source;
    this.tell = tell;
    this.lattice = new SliceLattice(source.planes);
    this.index = this.lattice.middle;
    this.window = [...source.window];
    this.#whole = source.window[1] - source.window[0];
    this.#space = space;
    this.#views = source.planes.map((_, number) => new SliceView(this, number));
    this.#place = element("p", { role: "status", className: "hint" });
    this.#ends = ["Black", "White"].map((name, end) => element("input", { type: "number", step: "any",
      "aria-label": `Value that is ${name.toLowerCase()}`, onchange: ({ target }) => this.#typed(end, target) }));
    const rows = ["Black", "White"].map((name, end) => element("label", {}, `${name} `, this.#ends[end]));
    const reset = element("button", { type: "button", onclick: () => this.resetWindow(),
      "aria-label": "Reset black and white" }, "Reset");
    this.controls = element("div", { className: "tools" }, ...rows, reset);
    get("slices").append(element("div", { className: "planes" }, ...this.#views.map(({ root }) => root)),
      this.#place, this.controls);
    get("slices-toggle").hidden = false;
    get("slices-toggle").onclick = () => this.#turn(!this.isOpen);
  }

  /** Whether slices are shown. */
  get isOpen() {
    return !get("slices").hidden;
  }

  /** The point of the world [3] of the crosshair. */
  get point() {
    return this.lattice.pointOf(this.index);
  }

  /** Put the crosshair at the nearest sample of an index; with the number of the plane that was used, if one was. */
  move(index, number = this.active) {
    this.index = this.lattice.within(index);
    this.active = number;
    this.#show();
  }

  /** Another plane is the active one. */
  choose(number) {
    if (number !== this.active) this.move(this.index, number);
  }

  /** Show values from black to white. */
  setWindow(low, high) {
    this.window = [low, Math.max(high, low + NARROWEST * this.#whole)];
    this.#show();
  }

  /** Make the window wider by a drag to the right, and move it up by one upwards. */
  dragWindow(x, y) {
    const [low, high] = this.window, width = (high - low) * Math.exp(x / FULL_DRAG);
    const level = (low + high) / 2 - y / FULL_DRAG * (high - low);
    this.setWindow(level - width / 2, level + width / 2);
  }

  /** Show the values that slices show at first. */
  resetWindow() {
    this.setWindow(...this.source.window);
  }

  /** Ask for all again: the volume is another, or labels have other colours. */
  refresh() {
    if (!this.isOpen) return;
    for (const view of this.#views) view.refresh();
    this.#tell();
  }

  #turn(isOn) {
    get("slices").hidden = !isOn;
    get("slices-toggle").setAttribute("aria-pressed", isOn);
    document.body.classList.toggle("sliced", isOn);
    this.dispatchEvent(new Event("open"));
    if (isOn) this.#show();
  }

  #show() {
    if (!this.isOpen) return;
    this.#views.forEach((view, number) => {
      view.root.classList.toggle("active", number === this.active);
      view.show();
    });
    this.#ends.forEach((input, end) => { input.value = Number(this.window[end].toPrecision(DIGITS)); });
    this.dispatchEvent(new Event("move"));
    this.#tell();
  }

  #typed(end, input) {
    const window = this.window.map((value, i) => i === end && input.value !== "" ? Number(input.value) : value);
    if (window[0] < window[1]) this.setWindow(...window);
    else this.tell(`Slices: expected black below white, got ${window.join(" and ")}.`);
    this.#show();
  }

  /** Say what is at the crosshair: its index, the place in the file's space, the value, and labels. */
  async #tell() {
    const number = ++this.#told;
    try {
      const place = await this.source.place(this.point);
      if (number === this.#told) this.#place.textContent = place ? this.#words(place) : "";
    } catch (error) {
      this.tell(`No value: ${error.message}`);
    }
  }

  #words({ index, position, value, labels }) {
    const least = Math.min(...this.lattice.planes.flatMap(({ spacing }) => spacing));
    const digits = Math.min(20, Math.max(0, 1 - Math.floor(Math.log10(least)))); // a tenth of a sample at most
    const words = position.map((x, i) => `${this.#space.axes[i]} ${x.toFixed(digits)}`).join(" ");
    const parts = [index.join(", "), `${words} ${this.#space.unit}`.trim()];
    if (value !== null) parts.push(`value ${Number(value.toPrecision(DIGITS + 1))}`);
    return [...parts, ...labels].join(" · ");
  }
}
