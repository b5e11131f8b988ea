// The size of a picture or a film, and the dialog of a picture that is not as the screen shows it.

import { element } from "./inputs.js";
import { MOST_PIXELS } from "./size.js";

const NO_BACKGROUND = ["truth", "difference", "wipe", "alpha", "ambient", "diffuse", "specular", "shininess"]; // modes

/** A number that a form requires, with a label. */
export function numberInput(label, properties) {
  const input = element("input", { type: "number", required: true, step: "any", ...properties });
  return { row: element("label", {}, label, input), input };
}

/** Width and height in pixels. */
export function sizeInputs() {
  const limits = { min: 1, max: MOST_PIXELS, step: 1 };
  const sides = ["Width, pixels", "Height, pixels"].map((label) => numberInput(label, limits));
  return {
    row: element("div", { className: "pair" }, ...sides.map(({ row }) => row)),
    show: (size) => sides.forEach(({ input }, i) => { input.value = size[i]; }),
    get value() { return sides.map(({ input }) => input.valueAsNumber); },
  };
}

export class PictureDialog {
  #page; #dialog;
  #size = sizeInputs();
  #transparent = element("input", { type: "checkbox" });

  /**
   * @param {ScenePage} page
   * @param {(how: {size: number[], transparent: boolean}) => void} save - a picture
   */
  constructor(page, save) {
    this.#page = page;
    const tick = element("label", { className: "tick" }, this.#transparent, "Transparent background");
    const buttons = element("menu", {}, element("button", { value: "save", className: "main" }, "Save picture"),
      element("button", { formNoValidate: true }, "Cancel"));
    const title = element("h2", {}, "Picture of another size");
    this.#dialog = element("dialog", { "aria-label": title.textContent },
      element("form", { method: "dialog" }, title, this.#size.row, tick, buttons));
    this.#dialog.addEventListener("close", () => {
      const transparent = this.#transparent.checked && !this.#transparent.disabled;
      if (this.#dialog.returnValue === "save") save({ size: this.#size.value, transparent });
    });
    document.body.append(this.#dialog);
    document.getElementById("still-size").onclick = () => this.#show();
  }

  #show() {
    this.#size.show(this.#page.renderer.size());
    this.#transparent.disabled = NO_BACKGROUND.includes(this.#page.shown.mode);
    this.#dialog.returnValue = "";
    this.#dialog.showModal();
  }
}
