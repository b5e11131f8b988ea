// One of the slices of a volume on a canvas, with a crosshair, and what moves it.

import { capital, element } from "./inputs.js";
import { sizeOf } from "./size.js";

const GAP = 7, LETTER = 13; // CSS pixels: of the crosshair around its place, and the height of letters
const NOTCH = 50, LINE = 16; // pixels of the wheel for a slice, and of one that counts in lines
const STILL = 4; // CSS pixels that a click may move
const CROSS = "#ffd54f";
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
const PAGES = { PageUp: 1, PageDown: -1 };

export class SliceView {
  #slices; #plane; #number; #canvas; #inputs;
  #picture = null;
  #asked = ""; // what the picture is of, or will be
  #isLoading = false;
  #drag = null; // what the pointer does, and where it was
  #begun = null; // where the latest drag or click did
  #turned = 0; // pixels of the wheel

  /**
   * @param {Slices} slices - with index, lattice, source, window; and what changes these
   * @param {number} number - of the plane
   */
  constructor(slices, number) {
    const plane = slices.lattice.planes[number], name = capital(plane.name), most = plane.count - 1;
    this.#slices = slices;
    this.#plane = plane;
    this.#number = number;
    this.#canvas = element("canvas", { tabIndex: 0, role: "application",
      "aria-label": `${name} slice. Arrow keys move the crosshair, Page Up and Page Down the slice.` });
    const oninput = ({ target }) => {
      if (target.value !== "" && target.validity.valid) this.#go(Number(target.value));
    };
    this.#inputs = ["range", "number"].map((type) => element("input", { type, min: 0, max: most, step: 1, oninput,
      "aria-label": `${name} slice${type === "number" ? ", as a number" : ""}` }));
    const words = element("span", { className: "name" }, name);
    const row = element("figcaption", { className: "row" }, words, ...this.#inputs);
    this.root = element("figure", { className: "slice" }, this.#canvas, row);
    this.#listen();
    new ResizeObserver(() => this.draw()).observe(this.#canvas);
  }

  /** Show the slice that the crosshair is in: the one before it stays until it is there. */
  async show() {
    const number = this.#slices.index[this.#number];
    for (const input of this.#inputs) if (Number(input.value) !== number) input.value = number;
    this.draw();
    if (this.#isLoading) return;
    this.#isLoading = true;
    while (this.#asked !== this.#wanted) { // what was wanted meanwhile is skipped, but for the newest
      this.#asked = this.#wanted;
      await this.#load();
    }
    this.#isLoading = false;
  }

  /** Ask for the slice again, as something else is drawn on it. */
  refresh() {
    this.#asked = "";
    this.show();
  }

  /** Draw the picture, the crosshair, and the letters of the ends. */
  draw() {
    const canvas = this.#canvas, [width, height] = sizeOf(canvas), pen = canvas.getContext("2d", { alpha: false });
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    pen.clearRect(0, 0, width, height);
    if (!this.#picture) return;
    const { left, top, column, row } = this.#frame(), [columns, rows] = this.#plane.size;
    pen.imageSmoothingEnabled = Math.min(column, row) < 1; // enlarged samples are squares, as they are
    pen.drawImage(this.#picture, left, top, columns * column, rows * row);
    this.#drawCross(pen);
    this.#drawEnds(pen);
  }

  get #wanted() {
    return JSON.stringify([this.#slices.index[this.#number], this.#slices.window]);
  }

  async #load() {
    const { source, index, window, tell } = this.#slices;
    try {
      const made = await source.slice(this.#plane, index[this.#number], window);
      const picture = made instanceof ImageData ? await createImageBitmap(made) : made;
      this.#picture?.close();
      this.#picture = picture;
      this.draw();
    } catch (error) {
      tell(`No slice: ${error.message}`);
    }
  }

  /** Where the slice is on the canvas, and how large a sample is, in pixels of the screen. */
  #frame() {
    const { width, height } = this.#canvas, { size: [columns, rows], spacing: [x, y] } = this.#plane;
    const scale = Math.min(width / (columns * x), height / (rows * y)), column = scale * x, row = scale * y;
    return { left: (width - columns * column) / 2, top: (height - rows * row) / 2, column, row };
  }

  #drawCross(pen) {
    const { left, top, column, row } = this.#frame(), [columns, rows] = this.#plane.size;
    const [across, down] = this.#slices.lattice.pixelOf(this.#plane, this.#slices.index);
    const x = left + (across + 0.5) * column, y = top + (down + 0.5) * row, gap = GAP * this.#ratio;
    pen.beginPath();
    for (const [from, to] of [[left, x - gap], [x + gap, left + columns * column]]) {
      if (from < to) { pen.moveTo(from, y); pen.lineTo(to, y); }
    }
    for (const [from, to] of [[top, y - gap], [y + gap, top + rows * row]]) {
      if (from < to) { pen.moveTo(x, from); pen.lineTo(x, to); }
    }
    pen.lineWidth = this.#ratio;
    pen.strokeStyle = CROSS;
    pen.stroke();
  }

  #drawEnds(pen) {
    const { width, height } = this.#canvas, letter = LETTER * this.#ratio;
    const [left, right, bottom, top] = this.#plane.ends;
    pen.font = `600 ${letter}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    pen.lineWidth = 3 * this.#ratio;
    pen.strokeStyle = "#000";
    pen.fillStyle = "#fff";
    for (const [words, x, y] of [[left, letter, height / 2], [right, width - letter, height / 2],
      [bottom, width / 2, height - letter], [top, width / 2, letter]]) {
      pen.strokeText(words, x, y);
      pen.fillText(words, x, y);
    }
  }

  /** Pixels of the screen in a pixel of the style. */
  get #ratio() {
    return this.#canvas.width / Math.max(this.#canvas.clientWidth, 1);
  }

  /** Go to a slice of this plane. */
  #go(number) {
    this.#slices.move(this.#slices.index.map((each, i) => i === this.#number ? number : each), this.#number);
  }

  /** Put the crosshair in a column and a row. */
  #put(pixel) {
    this.#slices.move(this.#slices.lattice.indexAt(this.#plane, pixel, this.#slices.index), this.#number);
  }

  #pointed({ offsetX, offsetY }) {
    const { left, top, column, row } = this.#frame(), ratio = this.#ratio;
    this.#put([Math.floor((offsetX * ratio - left) / column), Math.floor((offsetY * ratio - top) / row)]);
  }

  #listen() {
    const canvas = this.#canvas, slices = this.#slices;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.setPointerCapture(event.pointerId);
      this.#begun = event;
      this.#drag = { isOfWindow: event.button > 0 || event.shiftKey, last: event };
      if (!this.#drag.isOfWindow) this.#pointed(event);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!this.#drag) return;
      const { isOfWindow, last } = this.#drag;
      this.#drag.last = event;
      if (isOfWindow) slices.dragWindow(event.clientX - last.clientX, event.clientY - last.clientY);
      else this.#pointed(event);
    });
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, () => { this.#drag = null; });
    canvas.addEventListener("click", ({ clientX, clientY, shiftKey, detail }) => { // also at the end of a drag
      const moved = Math.hypot(clientX - this.#begun.clientX, clientY - this.#begun.clientY);
      if (moved < STILL && !shiftKey && detail === 1) slices.dispatchEvent(new Event("click"));
    });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    canvas.addEventListener("dblclick", () => slices.resetWindow());
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      const pixels = event.deltaY * (event.deltaMode ? LINE : 1);
      this.#turned -= Math.max(-NOTCH, Math.min(NOTCH, pixels)); // however far, a notch is one slice
      const steps = Math.trunc(this.#turned / NOTCH);
      this.#turned -= steps * NOTCH;
      if (steps) this.#go(slices.index[this.#number] + steps);
    }, { passive: false });
    canvas.addEventListener("keydown", (event) => {
      const { key } = event, arrow = ARROWS[key];
      if (event.ctrlKey || event.metaKey || event.altKey || !(arrow || PAGES[key])) return;
      event.preventDefault();
      const pixel = slices.lattice.pixelOf(this.#plane, slices.index);
      if (arrow) this.#put(pixel.map((x, i) => x + arrow[i]));
      else this.#go(slices.index[this.#number] + PAGES[key]);
    });
    canvas.addEventListener("focus", () => slices.choose(this.#number));
  }
}
