// What all pages of a scene share: a camera, the state, a renderer, and the inputs that choose what is shown.

import { AXES, OrbitCamera } from "./camera.js";
import { control } from "./controls.js";
import { capital } from "./inputs.js";
import { LightControl } from "./light.js";

const REST = 100; // milliseconds after the last movement until a whole frame is drawn
const NAMES = {
  shaded: "Shaded", unshaded: "Without light", normal: "Normals", depth: "Depth", alpha: "Opacity",
  texture: "Texture alone", discs: "Surfels as discs",
  ambient: "Ambient factor", diffuse: "Diffuse factor", specular: "Specular factor", shininess: "Shininess",
};
const get = (id) => document.getElementById(id);

export class ScenePage {
  #resting = 0; // timer
  #shown = { mode: "shaded", before: false, only: "" };
  #isLocked;

  /**
   * @param {State} state - of the scene
   * @param {object} renderer - on the canvas "picture", with the scene open
   * @param {() => boolean} isLocked - whether the camera has to stay
   */
  constructor(state, renderer, isLocked = () => false) {
    this.canvas = get("picture");
    this.state = state;
    this.renderer = renderer;
    this.camera = new OrbitCamera(state.scene);
    this.light = new LightControl(get("light"), state, this.camera);
    this.#isLocked = isLocked;
    this.#inputs();
    control(this.canvas, () => this.camera, () => this.moved(), (name) => this.goTo(name), isLocked);
    state.addEventListener("change", () => this.draw(true));
    new ResizeObserver(() => this.draw(true)).observe(this.canvas);
    window.addEventListener("hashchange", () => this.follow());
  }

  /** What of the scene is shown: `mode`, whether as it was `before`, and `only` which model, or all. */
  get shown() {
    return this.#shown;
  }

  /** Show something else of the scene. */
  show(values) {
    Object.assign(this.#shown, values);
    get("mode").value = this.#shown.mode;
    get("badge").hidden = !this.#shown.before;
    this.draw();
  }

  /** Draw a frame; while something moves, a fast one now and a whole one at rest. */
  draw(moving = false) {
    this.renderer.draw(this.camera, this.state.scene, { moving, ...this.#shown });
    clearTimeout(this.#resting);
    this.#resting = setTimeout(() => this.#rest(moving), REST);
  }

  /** The camera was moved. */
  moved() {
    get("view").value = "";
    get("fov").value = this.camera.fov_y;
    get("fov-value").textContent = `${Math.round(this.camera.fov_y)}°`;
    this.light.show();
    this.draw(true);
  }

  /** Go to a named view: "home", an axis, or one of the scene's. */
  goTo(name) {
    if (this.#isLocked()) return;
    const view = this.state.scene.views.find((each) => each.name === name);
    if (AXES[name]) {
      const [azimuth, polar] = AXES[name];
      this.camera.place({ azimuth, polar, target: this.camera.home.target });
    } else if (view && view !== this.state.scene.views[0]) {
      this.camera.place(view);
    } else {
      this.camera.goHome(this.canvas.clientWidth, this.canvas.clientHeight);
    }
    this.moved();
  }

  /** Go where the link says. */
  follow() {
    const fragment = location.hash.slice(1), mode = new URLSearchParams(fragment).get("mode");
    this.camera.goHome(this.canvas.clientWidth, this.canvas.clientHeight);
    this.camera.fromFragment(fragment);
    if (this.renderer.modes.includes(mode)) this.show({ mode });
    this.moved();
  }

  #rest(moving) {
    if (moving) this.renderer.draw(this.camera, this.state.scene, { moving: false, ...this.#shown });
    const { mode } = this.#shown;
    try {
      history.replaceState(null, "", `#${this.camera.toFragment()}${mode === "shaded" ? "" : `&mode=${mode}`}`);
    } catch {
      // a frame of another page may have no address of its own
    }
  }

  #inputs() {
    const mode = get("mode"), view = get("view"), fov = get("fov");
    mode.append(...this.renderer.modes.map((name) => new Option(NAMES[name] ?? name, name)));
    mode.addEventListener("change", () => this.show({ mode: mode.value }));
    const names = [...this.state.scene.views.map((each) => each.name), ...Object.keys(AXES)];
    view.append(...names.map((name) => new Option(AXES[name] ? `From ${name}` : capital(name), name)));
    view.addEventListener("change", () => {
      const { value } = view;
      if (value) this.goTo(value);
      view.value = value;
    });
    fov.addEventListener("input", () => {
      if (this.#isLocked()) return;
      this.camera.place({ fov_y: Number(fov.value) });
      this.moved();
    });
  }
}
