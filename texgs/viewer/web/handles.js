// Arrows over the picture, one for each plane that cuts and each side of the box: drawn along it, these move; by its
// tip, a plane tilts.

import { cross, dot } from "./camera.js";
import { gesture } from "./inputs.js";
import { addShape, path } from "./svg.js";

const LENGTH = 0.5; // of a plane's arrow, in radii of the scene
const SIDE_LENGTH = 0.15; // of that of a side of the box
const SHORT = 0.25; // of its length in the picture: below this it is seen from its end
const TURN = 5; // degrees a key
const CORNERS = 48; // of the rim
const HEAD = [[8, 0], [-8, 7], [-8, -7]]; // pixels along and across

export class PlaneHandles {
  #cuts; #page; #svg;
  #drawn = []; // by what is held: its group and a function that draws it
  #isOn = true;

  /**
   * @param {Cuts} cuts
   * @param {object} page - with camera, canvas, isOfCamera, shown and state
   */
  constructor(cuts, page) {
    this.#cuts = cuts;
    this.#page = page;
    this.#svg = document.getElementById("handles");
  }

  /** Show the arrows, or hide them. */
  turn(isOn) {
    this.#isOn = isOn;
    this.draw();
  }

  /** Draw the arrows as the camera sees them. */
  draw() {
    const { before, only } = this.#page.shown;
    const isShown = this.#isOn && !before && !only && this.#page.isOfCamera;
    this.#cuts.held.forEach((held, index) => {
      if (held) this.#drawn[index] ??= this.#make(index);
      this.#drawn[index]?.group.toggleAttribute("hidden", !(isShown && held && this.#drawn[index].place(held)));
    });
  }

  #project(point) {
    const { camera, canvas } = this.#page;
    return camera.project(point, canvas.clientWidth, canvas.clientHeight);
  }

  /** Pixels that a plane moves by for a unit of its offset; along the view: down, to the viewer. */
  #pixels(plane) {
    const { radius } = this.#page.state.scene.bounds, unit = radius / 100;
    const { normal } = plane, at = this.#cuts.middle(plane);
    const from = this.#project(at), to = this.#project(at.map((x, i) => x + unit * normal[i]));
    const along = [(to.x - from.x) / unit, (to.y - from.y) / unit];
    const isSeen = Math.hypot(...along) > SHORT * from.scale, { forward } = this.#page.camera.axes();
    return { from, isSeen, along: isSeen ? along : [0, dot(normal, forward) > 0 ? -from.scale : from.scale] };
  }

  #make(index) {
    const label = this.#cuts.name(index);
    const group = addShape(this.#svg, "g", { class: "plane", tabindex: 0, role: "slider", "aria-label": label });
    const [rim, reach, under, line, tip] = ["rim", "reach", "under", "line", "tip"].map(
      (name) => addShape(group, "path", { class: name }));
    const place = (plane) => {
      const { from, isSeen } = this.#pixels(plane), { radius } = this.#page.state.scene.bounds;
      const at = this.#cuts.middle(plane), reaches = (plane.corners ? SIDE_LENGTH : LENGTH) * radius;
      const to = this.#project(at.map((x, i) => x + reaches * plane.normal[i]));
      if (from.scale <= 0 || to.scale <= 0) return false;
      const shaft = path([[from.x, from.y], [to.x, to.y]]);
      for (const each of [reach, under, line]) each.setAttribute("d", shaft);
      rim.setAttribute("d", this.#outline(plane.corners ?? this.#rim(plane)));
      const length = Math.hypot(to.x - from.x, to.y - from.y) || 1;
      const u = [(to.x - from.x) / length, (to.y - from.y) / length];
      const corners = HEAD.map(([a, b]) => [to.x + a * u[0] - b * u[1], to.y + a * u[1] + b * u[0]]);
      tip.setAttribute("d", `${path(corners)}Z`);
      tip.style.pointerEvents = isSeen && !plane.corners ? "" : "none"; // what lies under it moves the plane
      const range = { min: -this.#cuts.far, max: this.#cuts.far, now: plane.offset.toFixed(3) };
      for (const [name, value] of Object.entries(range)) group.setAttribute(`aria-value${name}`, value);
      return true;
    };
    this.#listen(group, tip, index);
    return { group, place };
  }

  /** A closed line through corners in the picture; "" where one of them is behind the camera. */
  #outline(corners) {
    const seen = corners.map((corner) => this.#project(corner));
    return seen.every(({ scale }) => scale > 0) ? `${path(seen.map(({ x, y }) => [x, y]))}Z` : "";
  }

  /** Corners of where a plane leaves the ball around the scene. */
  #rim({ normal, offset }) {
    const { center, radius } = this.#page.state.scene.bounds, at = this.#cuts.middle({ normal, offset });
    const size = Math.sqrt(Math.max(0, radius ** 2 - (offset - dot(normal, center)) ** 2));
    const side = Math.abs(normal[1]) < 0.9 ? [0, 1, 0] : [1, 0, 0];
    const u = cross(normal, side), v = cross(normal, u), scale = size / Math.hypot(...u);
    return Array.from({ length: CORNERS }, (_, k) => {
      const angle = 2 * Math.PI * k / CORNERS, c = scale * Math.cos(angle), s = scale * Math.sin(angle);
      return at.map((x, i) => x + c * u[i] + s * v[i]);
    });
  }

  #listen(group, tip, index) {
    let last = null, tilts = false, change = () => {};
    gesture(group, (step) => change(step));
    const make = (of) => {
      change = of;
      group.dispatchEvent(new Event("input"));
    };
    group.addEventListener("pointerdown", (event) => {
      if (event.button) return;
      group.setPointerCapture(event.pointerId);
      tilts = event.target === tip || (event.shiftKey && !this.#cuts.heldBy(index).corners);
      last = event;
    });
    group.addEventListener("pointermove", (event) => {
      if (!group.hasPointerCapture(event.pointerId)) return;
      const x = event.clientX - last.clientX, y = event.clientY - last.clientY;
      make((step) => tilts ? this.#tilt(index, x, y, step) : this.#move(index, x, y, step));
      last = event;
    });
    group.addEventListener("keydown", (event) => {
      const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
      if (!arrow || event.ctrlKey || event.metaKey || event.altKey) return;
      event.preventDefault();
      const [x, y] = arrow, { radius } = this.#page.state.scene.bounds;
      const { from } = this.#pixels(this.#cuts.heldBy(index));
      const turn = TURN * Math.PI / 180 * LENGTH * radius * from.scale; // pixels of the tip
      make((step) => event.shiftKey && !this.#cuts.heldBy(index).corners ? this.#tilt(index, turn * x, turn * y, step)
        : this.#cuts.move(index, (x - y) * this.#cuts.unit, step));
    });
    for (const end of ["keyup", "lostpointercapture"]) {
      group.addEventListener(end, () => group.dispatchEvent(new Event("change")));
    }
  }

  /** The plane follows a pointer that moves by so many pixels. */
  #move(index, x, y, step) {
    const { along: [u, v] } = this.#pixels(this.#cuts.heldBy(index));
    this.#cuts.move(index, (x * u + y * v) / (u * u + v * v), step);
  }

  /** The tip of the arrow does. */
  #tilt(index, x, y, step) {
    const plane = this.#cuts.heldBy(index), { right, down } = this.#page.camera.axes();
    const { from } = this.#pixels(plane), unit = LENGTH * this.#page.state.scene.bounds.radius * from.scale;
    this.#cuts.tilt(index, plane.normal.map((n, i) => n + (x * right[i] + y * down[i]) / unit), step);
  }
}
