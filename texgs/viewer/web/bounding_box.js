// The box around the scene, or around its volume, over the picture.

import { dot } from "./camera.js";
import { tick } from "./inputs.js";
import { addShape, path } from "./svg.js";

const NEAR = 1e-3; // of the scene's radius: what is nearer to the camera cannot be drawn
const SIDES = ["low", "high"];
const CORNERS = SIDES.flatMap((x) => SIDES.flatMap((y) => SIDES.map((z) => [x, y, z])));
const isEdge = (one, other) => one.filter((side, i) => side !== other[i]).length === 1;

export class BoundingBox {
  #page; #shapes;
  #isOn = false;

  /** @param {ScenePage} page */
  constructor(page) {
    this.#page = page;
    const root = addShape(document.getElementById("marks"), "g", { class: "box" });
    this.#shapes = { hidden: addShape(root, "path", { class: "hidden-edges" }), seen: addShape(root, "path") };
    const toggle = tick("Bounds of the scene", (isOn) => {
      this.#isOn = isOn;
      this.draw();
    });
    document.getElementById("mark-inputs").append(toggle.row);
  }

  /** Draw it as the camera sees it; edges at the farthest corner lie behind what is in it. */
  draw() {
    const { bounds } = this.#page.state.scene, { camera } = this.#page, row = camera.viewmat()[2];
    const corners = CORNERS.map((sides) => sides.map((side, i) => bounds[side][i]));
    const depths = corners.map((corner) => dot(row, corner) + row[3]), far = depths.indexOf(Math.max(...depths));
    const words = { hidden: "", seen: "" };
    CORNERS.forEach((one, i) => CORNERS.slice(0, i).forEach((other, k) => {
      const edge = [[corners[i], depths[i]], [corners[k], depths[k]]];
      if (isEdge(one, other)) words[i === far || k === far ? "hidden" : "seen"] += this.#line(edge);
    }));
    for (const [name, shape] of Object.entries(this.#shapes)) shape.setAttribute("d", this.#isOn ? words[name] : "");
  }

  /** An edge in the picture, as far as it is before the camera; ends with their depths. */
  #line(edge) {
    const { camera, canvas, state } = this.#page, near = NEAR * state.scene.bounds.radius;
    const [[start, low], [end, high]] = edge.sort(([, one], [, other]) => one - other);
    if (high <= near) return "";
    const part = low >= near ? 0 : (near - low) / (high - low);
    const ends = [start.map((x, i) => x + part * (end[i] - x)), end];
    const seen = ends.map((point) => camera.project(point, canvas.clientWidth, canvas.clientHeight));
    return path(seen.map(({ x, y }) => [x, y]));
  }
}
