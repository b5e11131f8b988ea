// The editor of transfer functions over the histogram of the volume: points, peaks and colours that are dragged show
// the volume at once, through an edit of the scene.

import { added, colored, fresh, meanColor, moved, newName, removed, shifted } from "./functions.js";
import { colorInput, element, fromHex, gesture, replaceButtons, toHex } from "./inputs.js";
import { TransferPicture } from "./transfer_picture.js";

const FIRST = "#e69f00"; // of a new function
const SMALL = 0.005, LARGE = 0.05; // of the range, or of the opacity, that a key moves by
const ARROWS = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };

export class TransferEditor {
  #page; #presets; #picture;
  #name; // of the function that is edited
  #chosen = { key: "opacity", index: 1 }; // its point that inputs show
  #parts = {};
  #change = () => {}; // by what is dragged or pressed; takes the number of a step
  #drag = null;
  #making = ""; // name of the function that a model is being made of

  /**
   * @param {Element} place
   * @param {object} page - with shown, show() and state; where models can be made also job and mayBegin()
   * @param {{minimum: number, maximum: number, histogram: number[]}} transfer - of the volume
   * @param {object} presets - colours by name
   */
  constructor(place, page, transfer, presets) {
    this.#page = page;
    this.#presets = presets;
    this.#picture = new TransferPicture(transfer);
    for (const name of ["readout", "names", "inputs", "tools"]) this.#parts[name] = element("div", { className: name });
    place.replaceChildren(this.#picture.svg, ...Object.values(this.#parts));
    this.#buildInputs();
    this.#buildTools();
    this.#listen(this.#picture.svg);
    page.state.addEventListener("change", () => this.show());
    page.job?.addEventListener("end", () => { this.#making = ""; });
    this.show();
    this.#read();
  }

  /** Show the functions as they are. */
  show() {
    if (this.#making && !(this.#making in this.#tried)) { // its model is there
      this.#making = "";
      this.#page.show({ mode: "shaded" });
    }
    if (!this.#all[this.#name]) [this.#name] = Object.keys(this.#all);
    this.#chosen.index = Math.min(this.#chosen.index, this.#edited[this.#chosen.key].length - 1);
    if (!this.#drag) this.#picture.fit(this.#all);
    this.#picture.draw(this.#all, this.#name, this.#chosen);
    this.#showNames();
    this.#showInputs();
  }

  /** Those that the models were made by. */
  get #fitted() {
    return this.#page.state.scene.tfs;
  }

  /** The same, and those that are tried in place of them or beside them. */
  get #all() {
    return { ...this.#fitted, ...this.#tried };
  }

  get #tried() {
    return this.#page.state.scene.functions;
  }

  get #edited() {
    return this.#all[this.#name];
  }

  get #point() {
    return this.#edited[this.#chosen.key][this.#chosen.index];
  }

  /** Try another function in the place of the one that is edited. */
  #set(tf, step = 0) {
    if (tf !== this.#edited) this.#try({ ...this.#tried, [this.#name]: tf }, step);
  }

  #try(tried, step = 0) {
    if (this.#page.shown.mode !== "volume") this.#page.show({ mode: "volume" });
    this.#page.state.edit("", "functions", Object.keys(tried).length ? tried : null, step);
  }

  /** Move the chosen point, or change its channels. */
  #move(value, channels, step) {
    const { key, index } = this.#chosen;
    this.#set(moved(this.#edited, key, index, value, channels, this.#picture.range), step);
  }

  #choose(name) {
    this.#name = name;
    this.#chosen = { key: "opacity", index: 1 };
    this.show();
  }

  #pick({ key, index }) {
    if (key === this.#chosen.key && Number(index) === this.#chosen.index) return;
    this.#chosen = { key, index: Number(index) };
    this.show();
  }

  #add(tf) {
    this.#name = newName(Object.keys(this.#all));
    this.#try({ ...this.#tried, [this.#name]: tf });
  }

  // ---- Inputs -----------------------------------------------------------------

  #showNames() {
    replaceButtons(this.#parts.names, Object.entries(this.#all).map(([name, tf]) => {
      const isTried = name in this.#tried, swatch = element("span", { className: "swatch" });
      swatch.style.background = toHex(meanColor(tf));
      const title = `Edit ${name}, ${isTried ? "tried on the volume" : "as fitted"}`;
      return element("button", { type: "button", "aria-pressed": name === this.#name, title,
        onclick: () => this.#choose(name) }, swatch, isTried ? `${name} *` : name);
    }));
  }

  #showInputs() {
    const { value, alpha, color, back, make } = this.#parts, isOpacity = this.#chosen.key === "opacity";
    for (const [input, number] of [[value, this.#point[0]], [alpha, this.#point[1]]]) {
      if (document.activeElement !== input) input.value = Number(number.toPrecision(5));
    }
    alpha.parentElement.hidden = !isOpacity;
    color.row.hidden = isOpacity;
    if (!isOpacity) color.show(this.#point.slice(1), false);
    back.textContent = this.#name in this.#fitted ? "As fitted" : "Delete";
    back.disabled = make.disabled = !(this.#name in this.#tried);
  }

  #buildInputs() {
    const number = (label, limits, edit) => {
      const input = element("input", { type: "number", step: "any", ...limits, "aria-label": `${label} of the point` });
      gesture(input, (step) => {
        if (input.value !== "" && input.validity.valid) edit(Number(input.value), step);
      });
      input.addEventListener("blur", () => this.#showInputs()); // a value may have been refused or limited
      this.#parts.inputs.append(element("label", {}, `${label} `, input));
      return input;
    };
    this.#parts.value = number("Value", {}, (value, step) => this.#move(value, this.#point.slice(1), step));
    this.#parts.alpha = number("Opacity", { min: 0, max: 1 }, (alpha, step) => this.#move(this.#point[0], [alpha], step));
    this.#parts.color = colorInput("Colour", "colour of the point", (rgb, step) => this.#move(this.#point[0], rgb, step));
    this.#parts.color.row.querySelector(".reset").remove();
    this.#parts.inputs.append(this.#parts.color.row);
  }

  #buildTools() {
    const button = (text, title, onclick) => element("button", { type: "button", title, onclick }, text);
    this.#parts.back = button("As fitted", "Try this function no more", () => {
      const { [this.#name]: gone, ...others } = this.#tried;
      this.#try(others);
    });
    this.#parts.make = button("Make model", "Fit a model of this function: a first one in seconds", () => {
      if (this.#page.mayBegin() && this.#page.job.begin({ type: "fit", function: this.#name })) this.#making = this.#name;
    });
    const keep = button("Keep in data set", "Write this function into the file of its data set, for texgs run", () => {
      if (this.#page.mayBegin()) this.#page.job.begin({ type: "keep", function: this.#name });
    });
    keep.hidden = this.#parts.make.hidden = !this.#page.job;
    const presets = element("select", { "aria-label": "Colours of a preset", onchange: () => {
      this.#set(colored(this.#edited, this.#presets[presets.value]));
      presets.value = "";
    } }, new Option("Colours…", ""), ...Object.keys(this.#presets).map((name) => new Option(name, name)));
    this.#parts.tools.append(
      button("New", "Try one more function", () => this.#add(fresh(this.#picture.range, fromHex(FIRST)))),
      button("Copy", "Try a copy of this function", () => this.#add(this.#edited)), this.#parts.back, this.#parts.make, keep, presets);
  }

  #read(value) {
    this.#parts.readout.textContent = this.#picture.words(value);
  }

  // ---- Pointer and keys -------------------------------------------------------

  #listen(svg) {
    gesture(svg, (step) => this.#change(step));
    svg.addEventListener("pointerdown", (event) => event.button || this.#press(event));
    svg.addEventListener("pointermove", (event) => this.#follow(this.#picture.below(event)));
    svg.addEventListener("pointerleave", () => this.#read());
    svg.addEventListener("dblclick", (event) => this.#addOrRemove(this.#picture.below(event)));
    svg.addEventListener("focusin", ({ target: { dataset } }) => dataset.key && this.#pick(dataset));
    svg.addEventListener("keydown", (event) => this.#key(event));
    for (const end of ["keyup", "lostpointercapture"]) {
      svg.addEventListener(end, () => {
        this.#drag = null;
        svg.dispatchEvent(new Event("change"));
      });
    }
  }

  #press(event) {
    const { name, key, index } = event.target.dataset, { svg } = this.#picture;
    if (!name && !key) return;
    event.preventDefault();
    if (name && name !== this.#name) this.#choose(name);
    if (key) this.#pick({ key, index });
    if (key) this.#picture.focus({ key, index });
    this.#drag = { key, from: this.#picture.below(event).value, tf: this.#edited };
    svg.setPointerCapture(event.pointerId);
  }

  #follow({ value, alpha }) {
    this.#read(value);
    if (!this.#drag) return;
    const { key, from, tf } = this.#drag;
    this.#change = (step) => {
      if (!key) this.#set(shifted(tf, value - from, this.#picture.range), step);
      else this.#move(value, key === "opacity" ? [alpha] : this.#point.slice(1), step);
    };
    this.#picture.svg.dispatchEvent(new Event("input"));
  }

  /** A double click on a point removes it, elsewhere it adds one. */
  #addOrRemove({ value, alpha, isOnColors, drawn: { key, index } }) {
    if (key) {
      this.#set(removed(this.#edited, key, Number(index)));
      return;
    }
    const of = isOnColors ? "color" : "opacity";
    const [tf, place] = added(this.#edited, of, value, isOnColors ? undefined : [alpha]);
    this.#chosen = { key: of, index: place };
    this.#set(tf);
  }

  #key(event) {
    const { key, index } = event.target.dataset, arrow = ARROWS[event.key];
    if (!key || event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Delete" || event.key === "Backspace") {
      this.#set(removed(this.#edited, key, Number(index)));
    } else if (arrow) {
      const [low, high] = this.#picture.range, size = event.shiftKey ? LARGE : SMALL, [x, y] = arrow.map((a) => size * a);
      const [value, ...channels] = this.#point, shown = key === "opacity" ? [channels[0] + y] : channels;
      this.#change = (step) => this.#move(value + x * (high - low), shown, step);
      this.#picture.svg.dispatchEvent(new Event("input"));
    } else {
      return;
    }
    event.preventDefault();
  }
}
