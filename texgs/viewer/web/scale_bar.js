// A bar of a round length in a corner of the picture, as long as the same at what the camera turns around.

import { addShape, path } from "./svg.js";

const LONGEST = 140, MARGIN = 20, TICK = 5; // CSS pixels

export class ScaleBar {
  #page; #line; #words;

  /** @param {ScenePage} page */
  constructor(page) {
    this.#page = page;
    const root = addShape(document.getElementById("marks"), "g", { class: "scale" });
    [this.#line, this.#words] = ["path", "text"].map((tag) => addShape(root, tag));
  }

  /** Draw it for the camera: in the unit of the scene's volume, where it is known, or else in those of the world. */
  draw() {
    const { camera, canvas: { clientWidth, clientHeight }, state } = this.#page, { scale } = state.scene.bounds;
    const unit = state.scene.space?.unit || "volume units";
    const pixels = camera.project(camera.target, clientWidth, clientHeight).scale * (scale ?? 1); // of a unit
    const length = round(LONGEST / pixels), right = clientWidth - MARGIN, left = right - length * pixels;
    const y = clientHeight - MARGIN;
    this.#line.setAttribute("d", path([[left, y - TICK], [left, y], [right, y], [right, y - TICK]]));
    this.#words.setAttribute("x", right);
    this.#words.setAttribute("y", y - TICK - 3);
    this.#words.textContent = `${Number(length.toPrecision(1))} ${scale ? unit : "world units"}`;
  }
}

/** The largest of 1, 2 or 5 times a power of 10 that is at most so long. */
function round(most) {
  const power = 10 ** Math.floor(Math.log10(most));
  return power * [5, 2, 1].find((digit) => digit * power <= most * (1 + 1e-9));
}
