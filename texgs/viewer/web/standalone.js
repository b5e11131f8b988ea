// The page of an exported scene: the camera, the controls and the picture, without a server.

import { WebglRenderer } from "./webgl.js";

const START = { azimuth: 30, polar: 20 }; // degrees, where `texgs render` starts
const REST = 150; // milliseconds without a movement after which a frame is drawn in full
const FACTORS = { opacity: 2, ambient: 3, diffuse: 3, specular: 5, shininess: 5 }; // ends of sliders
const KEYS = { ArrowLeft: [-5, 0], ArrowRight: [5, 0], ArrowUp: [0, 5], ArrowDown: [0, -5] }; // degrees

const element = (id) => document.getElementById(id);
const clamp = (x, low, high) => Math.min(Math.max(x, low), high);
const toHex = (color) => `#${color.map((x) => Math.round(255 * clamp(x, 0, 1)).toString(16).padStart(2, "0")).join("")}`;
const fromHex = (text) => [1, 3, 5].map((i) => parseInt(text.slice(i, i + 2), 16) / 255);
const notice = (text) => { element("notice").textContent = text; };

/** A camera on a sphere around a target. */
class Orbit {
  constructor({ bounds, fov_y: fovY }) {
    this.bounds = bounds;
    this.fovY = fovY;
    this.reset();
  }

  reset() {
    const distance = this.bounds.radius / Math.sin((this.fovY * Math.PI) / 360);
    Object.assign(this, START, { target: [...this.bounds.center], distance });
  }

  turn(azimuth, polar) {
    this.azimuth += azimuth;
    this.polar = clamp(this.polar + polar, -90, 90);
  }

  /** Comes closer by a factor below 1, but no closer than surfels can be drawn quickly. */
  dolly(factor) {
    this.distance = clamp(this.distance * factor, 0.25 * this.bounds.radius + 0.2, 20 * this.bounds.radius);
  }

  /** Moves the target by parts of the picture's height. */
  pan(right, down) {
    const [x, y] = this.axes();
    const length = 2 * this.distance * Math.tan((this.fovY * Math.PI) / 360);
    this.target = this.target.map((value, k) => value - length * (right * x[k] + down * y[k]));
  }

  /** Unit vectors to the right, down, and forward. */
  axes() {
    const [a, p] = [(this.azimuth * Math.PI) / 180, (this.polar * Math.PI) / 180];
    const right = [-Math.sin(a), 0, -Math.cos(a)];
    const down = [Math.cos(a) * Math.sin(p), -Math.cos(p), -Math.sin(a) * Math.sin(p)];
    const forward = [-Math.cos(a) * Math.cos(p), -Math.sin(p), Math.sin(a) * Math.cos(p)];
    return [right, down, forward];
  }

  camera(width, height) {
    const axes = this.axes();
    const eye = this.target.map((x, k) => x - this.distance * axes[2][k]);
    const viewmat = axes.map((axis) => [...axis, -axis.reduce((sum, x, k) => sum + x * eye[k], 0)]);
    return { viewmat, fov_y: this.fovY, width, height };
  }
}

/** The scene on the canvas: draws when something has changed, coarser while it moves. */
class Picture {
  constructor(canvas, scene) {
    this.canvas = canvas;
    this.scene = scene;
    this.mode = "shaded";
    this.orbit = new Orbit(scene);
    this.renderer = new WebglRenderer(canvas, notice);
    this.size = [1, 1];
  }

  show(moving = false) {
    clearTimeout(this.resting);
    this.renderer.draw(this.orbit.camera(...this.size), this.scene, { mode: this.mode, moving });
    if (moving) this.resting = setTimeout(() => this.show(), REST);
  }

  /** Follows the size of the canvas in the pixels of the screen. */
  follow() {
    new ResizeObserver(([{ contentRect: { width, height } }]) => {
      this.size = [width, height].map((side) => Math.max(1, Math.round(side * devicePixelRatio)));
      this.show();
    }).observe(this.canvas);
  }

  /** Turns, moves and comes closer as pointers, wheel and keys say. */
  listen() {
    const pointers = new Map();
    const spread = () => {
      const [a, b] = [...pointers.values()];
      return Math.hypot(a[0] - b[0], a[1] - b[1]);
    };
    const on = (type, act) => this.canvas.addEventListener(type, act);
    on("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
    });
    on("pointermove", (event) => {
      if (!pointers.has(event.pointerId)) return;
      const before = pointers.size === 2 ? spread() : 0;
      const [x, y] = pointers.get(event.pointerId);
      const [dx, dy] = [event.clientX - x, event.clientY - y];
      pointers.set(event.pointerId, [event.clientX, event.clientY]);
      const height = this.canvas.clientHeight;
      if (before) this.orbit.dolly(before / Math.max(1, spread()));
      if (before || event.shiftKey || event.buttons & 6) this.orbit.pan(dx / height / pointers.size, dy / height / pointers.size);
      else this.orbit.turn((-180 * dx) / height, (180 * dy) / height);
      this.show(true);
    });
    for (const type of ["pointerup", "pointercancel"]) on(type, (event) => pointers.delete(event.pointerId));
    on("contextmenu", (event) => event.preventDefault());
    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.orbit.dolly(Math.exp(0.001 * event.deltaY * (event.deltaMode ? 30 : 1)));
      this.show(true);
    }, { passive: false });
    on("keydown", (event) => {
      if (event.key in KEYS) this.orbit.turn(...KEYS[event.key]);
      else if ("+=".includes(event.key)) this.orbit.dolly(0.9);
      else if (event.key === "-") this.orbit.dolly(1 / 0.9);
      else if (event.key === "Home") this.orbit.reset();
      else return;
      event.preventDefault();
      this.show();
    });
  }

  /** Saves what is shown as PNG. */
  save() {
    const [width, height] = this.size;
    const camera = this.orbit.camera(width, height);
    const canvas = Object.assign(document.createElement("canvas"), { width, height });
    const pixels = this.renderer.pixels(camera, this.scene, this.mode);
    canvas.getContext("2d").putImageData(new ImageData(pixels, width, height), 0, 0);
    canvas.toBlob((blob) => {
      const link = Object.assign(document.createElement("a"), { download: `${this.scene.name}.png`, href: URL.createObjectURL(blob) });
      link.click();
      URL.revokeObjectURL(link.href);
    });
  }
}

/** The controls of all parts, the light, the background and the mode. */
class Controls {
  constructor(form, picture) {
    this.picture = picture;
    this.form = form;
    this.original = structuredClone(picture.scene);
    this.build();
  }

  build() {
    const { scene } = this.picture;
    const parts = scene.models.flatMap((model) => [
      this.part(model.name, model, model),
      ...model.segments.map((segment) => this.part(`${model.name}/${segment.name}`, segment, model)),
    ]);
    this.words = Object.assign(document.createElement("input"), { readOnly: true, className: "words" });
    this.words.setAttribute("aria-label", "These edits as words of texgs edit");
    this.form.replaceChildren(...parts, this.light(scene), this.shown(scene), this.buttons(), this.words);
    this.tell();
  }

  changed() {
    this.tell();
    this.picture.show(true);
  }

  /** Edits of one part, of the keys that its kind can show. */
  part(name, { edit }, { can, fitted_palette: fitted }) {
    const rows = [];
    const set = (key) => (value) => { edit[key] = value; };
    if (can.includes("visible")) rows.push(this.check("visible", edit.visible, set("visible")));
    if (can.includes("palette")) rows.push(this.color("palette", edit.palette ?? fitted, set("palette")));
    for (const [key, end] of Object.entries(FACTORS)) {
      if (can.includes(key)) rows.push(this.range(key, edit[key], [0, Math.max(end, edit[key]), 0.01], set(key)));
    }
    return group(name, rows);
  }

  light(scene) {
    const { azimuth, polar } = scene.light ?? START;
    const angles = { azimuth, polar };
    const set = (key) => (value) => { angles[key] = value; scene.light = { ...angles }; head.querySelector("input").checked = false; };
    const head = this.check("headlight", !scene.light, (value) => { scene.light = value ? null : { ...angles }; });
    const rows = [this.range("azimuth", azimuth, [-180, 180, 1], set("azimuth")), this.range("polar", polar, [-90, 90, 1], set("polar"))];
    return group("Light", [head, ...rows]);
  }

  shown(scene) {
    const select = document.createElement("select");
    select.append(...this.picture.renderer.modes.map((mode) => new Option(mode, mode, false, mode === this.picture.mode)));
    select.addEventListener("change", () => { this.picture.mode = select.value; this.picture.show(); });
    return group("Picture", [row("mode", select), this.color("background", scene.background, (value) => { scene.background = value; })]);
  }

  buttons() {
    const box = Object.assign(document.createElement("div"), { className: "buttons" });
    const acts = {
      "Reset view": () => { this.picture.orbit.reset(); this.picture.show(); },
      "Reset edits": () => { Object.assign(this.picture.scene, structuredClone(this.original)); this.build(); this.picture.show(); },
      "Save picture": () => this.picture.save(),
    };
    for (const [text, act] of Object.entries(acts)) {
      const button = Object.assign(document.createElement("button"), { type: "button", textContent: text });
      button.addEventListener("click", act);
      box.append(button);
    }
    return box;
  }

  check(name, value, set) {
    const input = Object.assign(document.createElement("input"), { type: "checkbox", checked: value });
    input.addEventListener("input", () => { set(input.checked); this.changed(); });
    return row(name, input);
  }

  color(name, value, set) {
    const input = Object.assign(document.createElement("input"), { type: "color", value: toHex(value) });
    input.addEventListener("input", () => { set(fromHex(input.value)); this.changed(); });
    return row(name, input);
  }

  range(name, value, [min, max, step], set) {
    const input = Object.assign(document.createElement("input"), { type: "range", min, max, step, value });
    const output = Object.assign(document.createElement("output"), { value });
    input.addEventListener("input", () => { output.value = input.value; set(Number(input.value)); this.changed(); });
    return row(name, input, output);
  }

  /** Shows what differs from the scene as it was exported, as `texgs edit` takes it. */
  tell() {
    const words = [];
    const { scene } = this.picture;
    const differ = (now, before) => JSON.stringify(now) !== JSON.stringify(before);
    const compare = (name, now, before) => Object.keys(now).filter((key) => differ(now[key], before[key])).forEach((key) => {
      words.push(`${name}.${key}=${key === "palette" ? toHex(now[key]) : now[key]}`);
    });
    scene.models.forEach((model, i) => {
      const before = this.original.models[i];
      compare(model.name, model.edit, before.edit);
      model.segments.forEach((segment, k) => compare(`${model.name}/${segment.name}`, segment.edit, before.segments[k].edit));
    });
    const { light, background } = scene;
    if (differ(light, this.original.light)) words.push(`light=${light ? `${light.azimuth},${light.polar}` : "headlight"}`);
    if (differ(background, this.original.background)) words.push(`background=${toHex(background)}`);
    this.words.value = words.join(" ");
    this.words.hidden = !words.length;
  }
}

function row(name, ...controls) {
  const label = document.createElement("label");
  label.append(Object.assign(document.createElement("span"), { textContent: name }), ...controls);
  return label;
}

function group(name, rows) {
  const fieldset = document.createElement("fieldset");
  fieldset.append(Object.assign(document.createElement("legend"), { textContent: name }), ...rows);
  return fieldset;
}

async function main() {
  const canvas = element("view");
  const picture = new Picture(canvas, JSON.parse(element("scene").textContent));
  await picture.renderer.open(element("surfels").textContent, picture.scene);
  canvas.hidden = false;
  element("poster").hidden = true;
  new Controls(element("controls"), picture);
  element("panel").open = innerWidth > 720;
  picture.listen();
  picture.follow();
  notice("");
}

main().catch((error) => notice(error.message));
