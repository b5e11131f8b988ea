// Cuts of the scene: inputs of planes and a box, which take away what is beyond them.

import { angles, direction, dot } from "./camera.js";
import { capital, element, slider, tick } from "./inputs.js";
import { PlaneHandles } from "./handles.js";
import { placeOf } from "./space.js";

const MOST = 6; // planes, as the server has it
const SIDES = ["low", "high"].flatMap((side) => [0, 1, 2].map((axis) => ({ side, axis })));
const HELD = MOST + SIDES.length;
const same = (one, other) => JSON.stringify(one) === JSON.stringify(other);
const plain = ({ normal, offset }) => ({ normal, offset });

/** The unit vector of an axis, 0 to 2, on the side of another vector. */
const snapped = (vector, axis) => [0, 1, 2].map((i) => i === axis ? Math.sign(vector[axis]) || 1 : 0);

/** The same of the nearest axis. */
function nearest(vector) {
  const sizes = vector.map(Math.abs);
  return snapped(vector, sizes.indexOf(Math.max(...sizes)));
}

export class Cuts {
  planes = []; // {normal, offset, isOn, near}: those that are off are in this page alone
  unit; // of sliders and keys, world units
  far; // no plane beyond this offset cuts anything
  #page; #list; #add; #faces; #handles;
  #inputs = []; // functions that show the box, and each plane
  #lastBox; // the corners that a box has when it is turned on again

  /** @param {object} page - with camera, canvas, shown and state */
  constructor(page) {
    const { center, radius } = page.state.scene.bounds;
    this.#page = page;
    this.unit = 10 ** Math.floor(Math.log10(radius / 30));
    this.far = this.#rounded(Math.hypot(...center) + radius, Math.ceil);
    const side = (sign) => center.map((x) => this.#rounded(x + sign * radius));
    this.#lastBox = { low: side(-1), high: side(1) };
    this.#list = element("div");
    this.#add = element("button", { type: "button", onclick: () => this.#addPlane() }, "Add a plane");
    this.#faces = element("select", { onchange: () => this.#send(0) });
    this.#faces.append(new Option("Shaded", "shaded"), new Option("Without light", "unlit"));
    if (page.state.scene.slices) this.#faces.append(new Option("Slices", "slice"));
    const shown = tick("Arrows in the picture", (isOn) => this.#handles.turn(isOn));
    const name = element("span", { className: "name" }, "Faces");
    const faces = element("label", { className: "row" }, name, this.#faces);
    document.getElementById("cuts").append(this.#list, this.#add, this.#boxInputs(), faces, shown.row);
    this.#handles = new PlaneHandles(this, page);
    shown.show(true);
    page.state.addEventListener("change", () => this.show());
    this.show();
  }

  /** Whether there is room for another plane. */
  get hasRoom() {
    return this.planes.length < MOST;
  }

  /** Show the cuts as they are. */
  show() {
    const { planes, box, faces } = this.#page.state.scene.cuts;
    this.#take(planes);
    this.#lastBox = box ?? this.#lastBox;
    if (this.#list.children.length !== this.planes.length) {
      this.#inputs.length = 1; // that of the box
      this.#list.replaceChildren(...this.planes.map((_, index) => this.#planeInputs(index)));
    }
    for (const show of this.#inputs) show();
    this.#add.disabled = !this.hasRoom;
    this.#faces.value = faces;
    this.draw();
  }

  /** Draw what stands over the picture. */
  draw() {
    this.#handles.draw();
  }

  /** Put a plane with a slice in the place of another one, or beside the others; null: take that away.
   *
   * @param {?{normal: number[], offset: number}} before - undefined planes of the scene stay
   * @param {?object} plane
   * @param {number[]} window - values that are black and white
   */
  showSlice(before, plane, window, step) {
    const index = before ? this.planes.findIndex((each) => same(plain(each), before)) : -1;
    if (index >= 0) this.planes.splice(index, 1, ...(plane ? [{ ...plane, isOn: true }] : []));
    else if (plane) this.planes.push({ ...plane, isOn: true });
    this.#faces.value = plane ? "slice" : "shaded";
    this.#send(step, undefined, plane ? window : null);
  }

  /** The point of a plane that it is held at: the nearest to the one around which it was tilted, or the middle. */
  middle({ normal, offset, near = this.#page.state.scene.bounds.center }) {
    const distance = offset - dot(normal, near);
    return near.map((x, i) => x + distance * normal[i]);
  }

  /** What handles hold: planes, then sides of the box with their corners; undefined where one is off. */
  get held() {
    return Array.from({ length: HELD }, (_, index) => this.heldBy(index));
  }

  heldBy(index) {
    if (index < MOST) return this.planes[index]?.isOn ? this.planes[index] : undefined;
    const { box } = this.#page.state.scene.cuts, { side, axis } = SIDES[index - MOST], sign = side === "low" ? -1 : 1;
    if (!box) return undefined;
    const near = box.low.map((x, i) => (x + box.high[i]) / 2), [u, v] = [0, 1, 2].filter((i) => i !== axis);
    const corners = [["low", "low"], ["high", "low"], ["high", "high"], ["low", "high"]].map(([a, b]) =>
      [0, 1, 2].map((i) => i === axis ? box[side][i] : box[i === u ? a : b][i]));
    return { normal: [0, 1, 2].map((i) => i === axis ? sign : 0), offset: sign * box[side][axis], near, corners };
  }

  /** Its words. */
  name(index) {
    if (index < MOST) return `Plane ${index + 1}: arrow keys move it, with Shift they tilt it`;
    const { side, axis } = SIDES[index - MOST];
    return `${side === "low" ? "Lowest" : "Highest"} ${"xyz"[axis]} of the box: arrow keys move it`;
  }

  /** Move a plane, or a side of the box, along its normal. */
  move(index, length, step) {
    if (index >= MOST) {
      const { side, axis } = SIDES[index - MOST];
      this.#moveSide(side, axis, this.#lastBox[side][axis] + (side === "low" ? -length : length), step);
      return;
    }
    const offset = this.planes[index].offset + length;
    this.change(index, { offset: Math.min(this.far, Math.max(-this.far, offset)) }, step);
  }

  /** Give a plane another normal; it turns around where it is held. */
  tilt(index, vector, step) {
    const near = this.middle(this.planes[index]), length = Math.hypot(...vector);
    const normal = vector.map((x) => x / length);
    this.change(index, { normal, offset: dot(normal, near), near }, step);
  }

  /** Change some of a plane. */
  change(index, values, step = 0) {
    this.planes[index] = { ...this.planes[index], ...values };
    this.#send(step);
  }

  #rounded(x, round = Math.round) {
    return Number((round(x / this.unit) * this.unit).toFixed(9));
  }

  #send(step, box = this.#page.state.scene.cuts.box, window = this.#page.state.scene.cuts.window) {
    const planes = this.planes.filter((each) => each.isOn).map(plain);
    const kept = window ? { window } : {}; // values of slices
    const cuts = { planes, box, faces: this.#faces.value || this.#page.state.scene.cuts.faces, ...kept };
    if (same(cuts, this.#page.state.scene.cuts)) this.show();
    else this.#page.state.edit("", "cuts", cuts, step);
  }

  /** Take the planes of the scene, and keep those that are off. */
  #take(planes) {
    const on = this.planes.filter((each) => each.isOn);
    if (on.length === planes.length) {
      on.forEach((each, i) => Object.assign(each, planes[i]));
      return;
    }
    const isOff = (each) => !each.isOn && !planes.some((other) => same(plain(each), plain(other)));
    this.planes = [...planes.map((each) => ({ ...each, isOn: true })), ...this.planes.filter(isOff)];
  }

  /** A plane through the middle that takes away the half that is nearer. */
  #addPlane() {
    const { camera, state } = this.#page, normal = nearest(camera.axes().forward.map((x) => -x));
    this.planes.push({ normal, offset: this.#rounded(dot(normal, state.scene.bounds.center)), isOn: true });
    this.#send(0);
  }

  #planeInputs(index) {
    const name = `plane ${index + 1}`, plane = () => this.planes[index];
    const on = tick(capital(name), (isOn) => this.change(index, { isOn }), { title: "Cuts" });
    const position = this.#slider("Position", `position of ${name}`, this.far, this.unit,
      (offset, step) => this.change(index, { offset }, step));
    const angle = (label, key, most) => this.#slider(label, `${key} of the normal of ${name}, degrees`, most, 1,
      (value, step) => {
        const { azimuth, polar } = { ...angles(plane().normal), [key]: value };
        this.tilt(index, direction(azimuth, polar), step);
      });
    const azimuth = angle("Azimuth", "azimuth", 180), polar = angle("Polar", "polar", 90);
    const button = (text, what, onclick) =>
      element("button", { type: "button", onclick, "aria-label": `${what} ${name}` }, text);
    const { space } = this.#page.state.scene, place = element("div", { className: "place" });
    const box = element("fieldset", { className: "part" }, element("legend", {}, on.row), position.row, place,
      azimuth.row, polar.row, ...["x", "y", "z"].map((axis, i) => button(axis, `Snap to ${axis}:`,
        () => this.tilt(index, snapped(plane().normal, i)))),
      button("Flip", "Flip", () => {
        const { normal, offset } = plane();
        this.change(index, { normal: normal.map((x) => -x), offset: -offset });
      }),
      button("Remove", "Remove", () => {
        this.planes.splice(index, 1);
        this.#send(0);
        this.#add.focus();
      }));
    this.#inputs.push(() => {
      const { normal, offset, isOn } = plane(), angled = angles(normal);
      box.classList.toggle("hidden-part", !isOn);
      on.show(isOn);
      position.show(offset);
      place.textContent = space ? placeOf(space, normal, this.middle(plane())) : "";
      azimuth.show(Number(angled.azimuth.toFixed(1)));
      polar.show(Number(angled.polar.toFixed(1)));
    });
    return box;
  }

  #moveSide(side, axis, value, step) {
    const box = { ...this.#lastBox, [side]: [...this.#lastBox[side]] };
    box[side][axis] = side === "low" ? Math.max(-this.far, Math.min(value, box.high[axis] - this.unit))
      : Math.min(this.far, Math.max(value, box.low[axis] + this.unit));
    this.#send(step, box);
  }

  #boxInputs() {
    const isOn = () => this.#page.state.scene.cuts.box !== null;
    const on = tick("Box", (value) => this.#send(0, value ? this.#lastBox : null));
    const root = element("fieldset", { className: "part" }, element("legend", {}, on.row));
    const sliders = [0, 1, 2].flatMap((axis) => ["low", "high"].map((side) => {
      const what = `${side === "low" ? "lowest" : "highest"} ${"xyz"[axis]}`;
      const input = this.#slider(capital(what), `${what} of the box`, this.far, this.unit,
        (value, step) => this.#moveSide(side, axis, value, step));
      root.append(input.row);
      return () => {
        input.row.hidden = !isOn();
        input.show(this.#lastBox[side][axis]);
      };
    }));
    this.#inputs.push(() => {
      on.show(isOn());
      for (const show of sliders) show();
    });
    return root;
  }

  /** A slider around 0 that has nothing to be reset to. */
  #slider(label, what, most, step, edit) {
    const made = slider(label, what, { min: -most, max: most, most, step, unedited: NaN }, edit);
    made.row.querySelector(".reset").remove();
    return made;
  }
}
