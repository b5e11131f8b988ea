// The light: at the camera, or from a direction that is dragged on a ball or set by its angles; and its shadows.

import { angles, direction, dot } from "./camera.js";
import { element, gesture, slider, tick } from "./inputs.js";

const SIZE = 96; // CSS pixels of the ball
const BALL = 0.46; // its radius, part of the size

export class LightControl {
  #state; #camera; #canvas; #headlight; #azimuth; #polar;
  #shares; // sliders of what matter takes away of light, by their keys
  #hint = element("p", { className: "hint" });

  /**
   * @param {Element} root - for its inputs
   * @param {State} state
   * @param {OrbitCamera} camera - the ball is seen as the scene is
   */
  constructor(root, state, camera) {
    this.#state = state;
    this.#camera = camera;
    this.#canvas = element("canvas", { className: "ball", title: "Drag to turn the light" });
    this.#canvas.setAttribute("aria-hidden", "true"); // the angles beside it do the same
    this.#headlight = tick("Headlight", (on) => this.#set(on ? null : this.#atCamera(), 0));
    const angle = (key, name, most) => slider(
      name, `${key} of the light, degrees`, { min: -most, max: most, most, step: 1, unedited: NaN },
      (value, step) => this.#set({ ...this.#angles(), [key]: value }, step),
    );
    this.#azimuth = angle("azimuth", "Azimuth", 180);
    this.#polar = angle("polar", "Polar", 90);
    for (const { row } of [this.#azimuth, this.#polar]) row.querySelector(".reset").remove();
    const share = (key, name, what) => [key, slider(
      name, what, { max: 1, most: 1, unedited: 0 }, (value, step) => state.edit("", key, value, step),
    )];
    this.#shares = state.scene.can_shadow ? [
      share("shadows", "Shadows", "shadows"), share("occlusion", "Occlusion", "occlusion of ambient light"),
    ] : [];
    const about = element("div", {}, this.#headlight.row,
      this.#hint);
    root.append(element("div", { className: "light" }, this.#canvas, about), this.#azimuth.row, this.#polar.row,
      ...this.#shares.map(([, { row }]) => row));
    root.hidden = !state.scene.models.some((model) => model.can.includes("diffuse")); // nothing shows the light
    this.#listen();
    state.addEventListener("change", () => this.show());
    this.show();
  }

  /** Show the light as it is, seen from where the camera is. */
  show() {
    const { scene } = this.#state, { light } = scene, { azimuth, polar } = this.#angles();
    this.#headlight.show(light === null);
    this.#hint.textContent = light ? "Drag on the ball to turn the light."
      : `It moves with the camera${scene.can_shadow ? " and casts no shadows" : ""}. Drag on the ball to fix the light.`;
    this.#azimuth.show(azimuth);
    this.#polar.show(polar);
    for (const [key, input] of this.#shares) input.show(scene[key]);
    this.#draw();
  }

  #angles() {
    return this.#state.scene.light ?? this.#atCamera();
  }

  #atCamera() {
    const { azimuth, polar } = this.#camera;
    return { azimuth: Math.round(azimuth), polar: Math.round(polar) };
  }

  #set(light, step) {
    this.#state.edit("", "light", light, step);
  }

  #listen() {
    const canvas = this.#canvas;
    let box = null;
    const use = (event) => {
      if (event.type === "pointerdown") {
        canvas.setPointerCapture(event.pointerId);
        box = canvas.getBoundingClientRect(); // the panel may move under the pointer
      } else if (!canvas.hasPointerCapture(event.pointerId)) return;
      this.#point = [0.5 - (event.clientX - box.left) / box.width, 0.5 - (event.clientY - box.top) / box.height];
      canvas.dispatchEvent(new Event("input"));
    };
    canvas.addEventListener("pointerdown", use);
    canvas.addEventListener("pointermove", use);
    canvas.addEventListener("lostpointercapture", () => canvas.dispatchEvent(new Event("change")));
    gesture(canvas, (step) => this.#set(this.#lightAt(this.#point), step));
  }

  #point = [0, 0]; // to the left and up from the middle, parts of the size

  /** The light at a point of the ball's near half; beyond its rim, at the rim. */
  #lightAt([left, up]) {
    const { right, down, forward } = this.#camera.axes();
    const scale = 1 / Math.max(BALL, Math.hypot(left, up)), x = -left * scale, y = -up * scale;
    const z = -Math.sqrt(Math.max(0, 1 - x * x - y * y));
    const { azimuth, polar } = angles([0, 1, 2].map((i) => x * right[i] + y * down[i] + z * forward[i]));
    return { azimuth: Math.round(azimuth), polar: Math.round(polar) };
  }

  /** A ball under the light, and a ring where it comes from: dashed if that is behind. */
  #draw() {
    const canvas = this.#canvas, side = Math.round(SIZE * window.devicePixelRatio), radius = BALL * side;
    if (canvas.width !== side) canvas.width = canvas.height = side;
    const context = canvas.getContext("2d"), middle = side / 2;
    const { right, down, forward } = this.#camera.axes();
    const { azimuth, polar } = this.#angles();
    const to = direction(azimuth, polar);
    const x = middle + radius * dot(to, right), y = middle + radius * dot(to, down);
    const isBehind = dot(to, forward) > 0;
    const shade = context.createRadialGradient(x, y, 0, x, y, 2 * radius);
    for (const [stop, grey] of isBehind ? [[0, 130], [0.5, 60], [1, 40]] : [[0, 255], [0.5, 150], [1, 40]]) {
      shade.addColorStop(stop, `rgb(${grey} ${grey} ${grey})`);
    }
    context.clearRect(0, 0, side, side);
    context.fillStyle = shade;
    context.beginPath();
    context.arc(middle, middle, radius, 0, 2 * Math.PI);
    context.fill();
    context.strokeStyle = "#e07a1f";
    context.lineWidth = side / 40;
    context.setLineDash(isBehind ? [side / 24, side / 24] : []);
    context.beginPath();
    context.arc(x, y, side / 16, 0, 2 * Math.PI);
    context.stroke();
  }
}
