// The axes of the world in a corner of the picture; a click on an end looks along it.

import { AXES, direction, dot } from "./camera.js";
import { addShape } from "./svg.js";

const REACH = 32, MARGIN = 50; // CSS pixels from the middle to an end, and to the sides of the picture
const RADIUS = { "+": 9, "−": 6 }; // of ends
const COLORS = { x: "#c62828", y: "#2e7d32", z: "#1565c0" };

export class Gizmo {
  #page; #root; #ends;

  /** @param {ScenePage} page - keys and a list do the same as this, so it is hidden from readers of screens */
  constructor(page) {
    this.#page = page;
    this.#root = addShape(document.getElementById("marks"), "g", { class: "gizmo" });
    const ends = page.state.scene.space?.ends ?? [..."xyz"].map((letter) => [letter, ""]);
    this.#ends = Object.entries(AXES).map(([name, angles]) => this.#make(name, direction(...angles), ends));
  }

  /** Draw the axes as the camera sees them, the farthest end first. */
  draw() {
    const { camera, canvas } = this.#page, { right, down, forward } = camera.axes();
    this.#root.setAttribute("transform", `translate(${canvas.clientWidth - MARGIN} ${MARGIN})`);
    this.#ends.sort((one, other) => dot(forward, other.axis) - dot(forward, one.axis));
    for (const { axis, group, line, end } of this.#ends) {
      const x = REACH * dot(right, axis), y = REACH * dot(down, axis);
      this.#root.append(group);
      line.setAttribute("x2", x);
      line.setAttribute("y2", y);
      end.setAttribute("transform", `translate(${x} ${y})`);
    }
  }

  /** @param {string[][]} ends - letters ahead and behind along x, y and z: of the patient, or of the file */
  #make(name, axis, ends) {
    const [sign, letter] = name, color = COLORS[letter], words = ends["xyz".indexOf(letter)][sign === "+" ? 0 : 1];
    const group = addShape(this.#root, "g", { class: sign === "+" ? "ahead" : "behind", stroke: color, fill: color });
    const line = addShape(group, "line"), end = addShape(group, "g", { class: "end" });
    addShape(end, "title").textContent = words && words !== letter ? `From ${words} (${name})` : `From ${name}`;
    addShape(end, "circle", { r: RADIUS[words ? "+" : "−"] });
    if (words) addShape(end, "text", { y: 4 }).textContent = words;
    end.addEventListener("click", () => this.#page.goTo(name));
    return { axis, group, line, end };
  }
}
