// The crosshair of slices in the scene: a mark, clicks that move it to what is seen, and a cut that shows a slice.

import { dot } from "./camera.js";
import { pointBelow } from "./center.js";
import { BURST, newGesture, tick } from "./inputs.js";
import { addShape, path } from "./svg.js";

const STILL = 4; // CSS pixels that a click may move
const ARM = 14, GAP = 5; // of the mark

export class SlicesInScene {
  #page; #slices; #mark; #tick;
  #plane = null; // that cuts the scene and shows a slice: {normal, offset}
  #active; // number of its plane of slices
  #step = 0; // of the history, as long as it moves
  #resting = 0; // timer

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
    this.#tick = tick("In the scene", (isOn) => this.#turn(isOn), { title: "Cut the scene there, and show the slice" });
    slices.controls.append(this.#tick.row);
    slices.addEventListener("open", () => this.draw());
    slices.addEventListener("move", () => {
      this.draw();
      if (this.#isCut) this.#cut();
    });
    let shown = this.#looks;
    page.state.addEventListener("change", () => {
      this.#tick.show(this.#isCut);
      if (page.state.isPending || this.#looks === shown) return;
      shown = this.#looks;
      slices.refresh();
    });
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

  /** What slices show of the scene: its step, and how labels look. */
  get #looks() {
    const { models, time } = this.#page.state.scene;
    return JSON.stringify([time, models.map(({ edit }) => edit)]);
  }

  /** Whether the scene has the cut still: it may have been taken back. */
  get #isCut() {
    const { planes, faces } = this.#page.state.scene.cuts;
    return faces === "slice" && planes.some((each) => JSON.stringify(each) === JSON.stringify(this.#plane));
  }

  #turn(isOn) {
    if (isOn && !this.#page.cuts.hasRoom) {
      this.#slices.tell("No more planes can cut the scene: remove one.");
      this.#tick.show(false);
    } else if (isOn) {
      this.#cut();
    } else {
      this.#page.cuts.showSlice(this.#plane, null, null, 0);
      this.#plane = null;
    }
  }

  /** Cut the scene in the active plane at the crosshair: what is nearer to the camera is taken away. */
  #cut() {
    const { active, lattice, point, window } = this.#slices, [axis, sign] = lattice.planes[active].axis;
    const before = this.#isCut ? this.#plane : null;
    const along = [0, 1, 2].map((i) => i === axis ? sign : 0);
    const isKept = before && active === this.#active; // the side does not change while the crosshair moves
    const normal = isKept ? before.normal : along.map((x) => dot(along, this.#page.camera.axes().forward) > 0 ? -x : x);
    this.#active = active;
    this.#plane = { normal, offset: dot(normal, point) };
    clearTimeout(this.#resting);
    this.#resting = setTimeout(() => { this.#step = 0; }, BURST);
    this.#step ||= newGesture();
    this.#page.cuts.showSlice(before, this.#plane, window, this.#step);
  }
}
