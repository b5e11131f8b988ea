// What a film is like: its size, how long it is, and how many frames a second it has.

import { element } from "./inputs.js";
import { numberInput, sizeInputs } from "./size_inputs.js";

const KINDS = ["mp4", "gif"];
const get = (id) => document.getElementById(id);

export class FilmInputs {
  #renderer;
  #size = sizeInputs();
  #seconds = numberInput("Length, seconds", { min: 0.1, max: 600, value: 2.88 }); // 72 frames
  #fps = numberInput("Frames a second", { min: 1, max: 240, value: 25 });

  constructor(renderer) {
    this.#renderer = renderer;
    const length = element("div", { className: "pair" }, this.#seconds.row, this.#fps.row);
    get("film").append(this.#size.row, length);
    get("export-kind").addEventListener("change", () => this.#hide());
  }

  /** Begin with the size on the screen. */
  show() {
    this.#size.show(this.#renderer.size());
    this.#hide();
  }

  get values() {
    const length = { seconds: this.#seconds.input.valueAsNumber, fps: this.#fps.input.valueAsNumber };
    return get("film").disabled ? {} : { size: this.#size.value, ...length };
  }

  /** What is no film has no inputs that a form could require. */
  #hide() {
    get("film").hidden = get("film").disabled = !KINDS.includes(get("export-kind").value);
  }
}
