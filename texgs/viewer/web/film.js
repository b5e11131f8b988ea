// What a film is like: the way of its camera, its size, how long it is, and how many frames a second it has.

import { element } from "./inputs.js";
import { numberInput, sizeInputs } from "./size_inputs.js";

const KINDS = ["mp4", "gif"];
const get = (id) => document.getElementById(id);

export class FilmInputs {
  #page;
  #size = sizeInputs();
  #seconds = numberInput("Length, seconds", { min: 0.1, max: 600, value: 4 });
  #fps = numberInput("Frames a second", { min: 1, max: 240, value: 25 });

  #way = element("select", {}, new Option("One turn", "turn"), new Option("Through the bookmarks", "bookmarks"));

  /** @param {ScenePage} page */
  constructor(page) {
    this.#page = page;
    const length = element("div", { className: "pair" }, this.#seconds.row, this.#fps.row);
    get("film").append(element("label", { className: "row" }, "Camera", this.#way), this.#size.row, length);
    get("export-kind").addEventListener("change", () => this.#hide());
  }

  /** Begin with the size on the screen. */
  show() {
    this.#size.show(this.#page.renderer.size());
    this.#way.options[1].disabled = this.#page.bookmarks.poses.length < 2;
    if (this.#way.options[1].disabled) this.#way.value = "turn";
    this.#hide();
  }

  get values() {
    if (get("film").disabled) return {};
    const { value: size } = this.#size, isTurn = this.#way.value === "turn";
    const stops = isTurn ? [] : this.#page.bookmarks.poses.map((pose) => ({ ...pose, width: size[0], height: size[1] }));
    return { size, stops, seconds: this.#seconds.input.valueAsNumber, fps: this.#fps.input.valueAsNumber };
  }

  /** What is no film has no inputs that a form could require. */
  #hide() {
    get("film").hidden = get("film").disabled = !KINDS.includes(get("export-kind").value);
  }
}
