// The crosshair of slices in the scene: a mark, and clicks that move it to what is seen there.

import { pointBelow } from "./center.js";
import { addShape, path } from "./svg.js";

const STILL = 4; // CSS pixels that a click may move
const ARM = 14, GAP = 5; // of the mark

export class SlicesInScene {
  #page; #slices; #mark;

  /**
   * @param {ScenePage} page
   * @param {Slices} slices
   * @param {() => boolean} isLocked - whether clicks do something else
   */
  constructor(page, slices, isLocked) {
    this.#page = page;
    this.#slices = slices;
    const root = addShape(document.getElementById("marks"), "g", { class: "crosshair" });
    this.#mark = ["under", "line"].map((name) => addShape(root, "path", { class: name }));
    for (const name of ["move", "open"]) slices.addEventListener(name, () => this.draw());
    let down = null;
    page.canvas.addEventListener("pointerdown", (event) => { down = event; });
    page.canvas.addEventListener("click", (event) => {
      const moved = down ? Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) : 0;
      if (slices.isOpen && page.isOfCamera && moved < STILL && !isLocked()) this.#go(event);
    });
  }

  /** Draw the mark where the camera sees the crosshair. */
  draw() {
    const { camera, canvas } = this.#page;
    const { x, y, scale } = camera.project(this.#slices.point, canvas.clientWidth, canvas.clientHeight);
    const arms = [[1, 0], [-1, 0], [0, 1], [0, -1]].map(([u, v]) =>
      path([[x + GAP * u, y + GAP * v], [x + ARM * u, y + ARM * v]]));
    const words = this.#slices.isOpen && scale > 0 ? arms.join("") : "";
    for (const each of this.#mark) each.setAttribute("d", words);
  }

  async #go(event) {
    const point = await pointBelow(this.#page, event);
    if (point) this.#slices.move(this.#slices.lattice.nearest(point));
  }
}
