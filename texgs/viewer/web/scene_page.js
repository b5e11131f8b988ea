// What all pages of a scene share: a camera, the state, a renderer, and the inputs that choose what is shown.

import { Bookmarks } from "./bookmarks.js";
import { BoundingBox } from "./bounding_box.js";
import { AXES, OrbitCamera } from "./camera.js";
import { centerByDoubleClick } from "./center.js";
import { control } from "./controls.js";
import { copyLinkBy } from "./copy_link.js";
import { Cuts } from "./cuts.js";
import { Gizmo } from "./gizmo.js";
import { capital, element } from "./inputs.js";
import { Legend } from "./legend.js";
import { LightControl } from "./light.js";
import { editsOf } from "./link.js";
import { MarkerShapes } from "./marker_shapes.js";
import { Measure } from "./measure.js";
import { ScaleBar } from "./scale_bar.js";
import { Slices } from "./slices.js";
import { SlicesInScene } from "./slices_in_scene.js";
import { difference, edited } from "./state.js";

const REST = 100; // milliseconds after the last movement until a whole frame is drawn
const HELD = 500; // the same while a button is down: a hand that pauses goes on, and needs the processors then
const ERROR = "Of the worst channel: red where the scene is too bright, blue where it is too dark.";
const MODES = { // names, and what their colours mean
  shaded: ["Shaded", ""],
  unshaded: ["Without light", ""],
  normal: ["Normals", "Red, green and blue are x, y and z, grey is 0."],
  depth: ["Depth", "Black is the nearest point of the view, light grey the farthest."],
  alpha: ["Opacity", "Black is transparent, white opaque."],
  texture: ["Texture alone", "What textures add to the palette; grey adds nothing."],
  discs: ["Surfels as discs", "Each has the radius of one standard deviation."],
  volume: ["Volume", ""],
  truth: ["Nearest training view", "This scene names no volume, which would be shown from anywhere."],
  difference: ["Difference from that view", ERROR],
  ambient: ["Ambient factor", "Black is 0, white 1."],
  diffuse: ["Diffuse factor", "Black is 0, white 1."],
  specular: ["Specular factor", "Black is 0, white 1."],
  shininess: ["Shininess", "Black is 0, white 100."],
};
const OF_VOLUME = { // the same, where the scene names its volume
  difference: ["Scene − volume", ERROR],
  wipe: ["Scene and volume", "Drag the line, or move it by arrow keys."],
};
const OPTIONS = { shaded: "", truth: "", difference: " --compare", wipe: " --compare" }; // of `texgs render`
const get = (id) => document.getElementById(id);

/** Whether an edit changes a scene. */
function isDifferent(scene, edit) {
  return JSON.stringify(edited(scene, edit)) !== JSON.stringify(scene);
}

export class ScenePage {
  #resting = 0; // timer
  #still = REST;
  #moving = false; // whether the newest frame was drawn for something that moves
  #shown = { mode: "shaded", before: false, only: "", gain: 4, wipe: 0.5, legend: false };
  #isLocked;
  #marks; // what lies over the picture

  /**
   * @param {State} state - of the scene
   * @param {object} renderer - on the canvas "picture", with the scene open
   * @param {Notices} notices
   * @param {() => boolean} isLocked - whether the camera has to stay
   */
  constructor(state, renderer, notices, isLocked = () => false) {
    this.canvas = get("picture");
    this.state = state;
    this.renderer = renderer;
    renderer.onframe = (view, facts) => this.framed(view, facts);
    this.camera = new OrbitCamera(state.scene);
    this.light = new LightControl(get("light"), state, this.camera);
    this.notices = notices;
    this.#isLocked = isLocked;
    this.cuts = new Cuts(this);
    this.measure = new Measure(this, isLocked);
    this.#marks = [this.cuts, new BoundingBox(this), new Legend(this), new MarkerShapes(this), new Gizmo(this),
      new ScaleBar(this)];
    this.bookmarks = new Bookmarks(this);
    this.#inputs();
    control(this.canvas, () => this.camera, () => this.moved(), (name) => this.goTo(name), isLocked);
    copyLinkBy(get("link"), this);
    centerByDoubleClick(this, () => isLocked() || this.measure.isOn);
    state.addEventListener("edit", () => { // who edits wants to see it
      if (this.#shown.before) this.show({ before: false });
    });
    state.addEventListener("change", () => this.draw(true));
    window.addEventListener("pointerdown", () => this.#hold(HELD), true);
    for (const end of ["pointerup", "pointercancel"]) window.addEventListener(end, () => this.#hold(REST), true);
    new ResizeObserver(() => this.draw(true)).observe(this.canvas);
    document.addEventListener("refused", ({ detail }) => notices.tell(detail, "error"));
    window.addEventListener("hashchange", () => this.follow());
  }

  /** Offer slices of the scene's volume, from a source that `Slices` describes. */
  addSlices(source) {
    const space = this.state.scene.space ?? { axes: "xyz", unit: "" };
    const slices = new Slices(source, space, (text) => this.notices.tell(text, "error"));
    slices.addEventListener("click", () => this.measure.click(slices.point));
    this.#marks.push(new SlicesInScene(this, slices, this.#isLocked));
  }

  /** What of the scene is shown: `mode`, whether as it was `before`, `only` which model, or all; `gain` and
   * `wipe` of what is beside its volume; whether with a `legend`. */
  get shown() {
    return this.#shown;
  }

  /** Whether the picture is seen from the camera, and not from the nearest training view. */
  get isOfCamera() {
    return Boolean(this.state.scene.volume) || !["truth", "difference"].includes(this.#shown.mode);
  }

  /** Show something else of the scene. */
  show(values) {
    Object.assign(this.#shown, values);
    get("mode").value = this.#shown.mode;
    get("before").setAttribute("aria-pressed", this.#shown.before);
    this.draw(true);
  }

  /** Say what is on the screen now: it may be older than what is chosen. */
  framed({ mode, before }) {
    this.onScreen = mode;
    get("mode-legend").textContent = this.words(mode)[1];
    get("badge").hidden = !before;
    this.compare?.show();
  }

  /** Draw a frame; while something moves, a fast one now and a whole one at rest. */
  draw(moving = false) {
    this.renderer.draw(this.camera, this.state.scene, { moving, ...this.#shown });
    get("marks").toggleAttribute("hidden", !this.isOfCamera);
    for (const each of this.#marks) each.draw();
    this.compare?.show();
    this.#moving = moving;
    this.#waitForRest();
  }

  #waitForRest() {
    clearTimeout(this.#resting);
    const still = Math.max(this.#still, 2 * this.renderer.took, this.time?.pause ?? 0);
    this.#resting = setTimeout(() => this.#rest(), still);
  }

  /** A button or finger goes down or up. */
  #hold(still) {
    this.#still = still;
    if (this.#resting) this.#waitForRest();
  }

  /** The camera was moved. */
  moved() {
    get("view").value = "";
    get("fov").value = this.camera.fov_y;
    get("fov-value").textContent = `${Math.round(this.camera.fov_y)}°`;
    this.light.show();
    this.draw(true);
  }

  /** Put the camera somewhere, and return whether it may move; what is not named stays. */
  place(pose) {
    if (this.#isLocked()) return false;
    this.camera.place(pose);
    this.moved();
    return true;
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

  /** Go where the link says, and make its edits, as far as they are not made. */
  follow() {
    if (this.#isLocked()) return;
    const words = new URLSearchParams(location.hash.slice(1)), { modes } = this.renderer, { scene } = this.state;
    const mode = words.get("mode") ?? "shaded", wrong = modes.includes(mode) ? [] : ["mode"];
    this.camera.goHome(this.canvas.clientWidth, this.canvas.clientHeight);
    this.camera.follow(words, wrong);
    this.show({ mode: modes.includes(mode) ? mode : "shaded" });
    const isOfAnother = (words.get("scene") ?? scene.name) !== scene.name;
    const edits = isOfAnother ? [] : editsOf(words.get("edits"), scene, wrong);
    this.bookmarks.follow(words, edits, wrong);
    const missing = edits.filter((edit) => isDifferent(scene, edit));
    if (missing.length) this.makeEdits(missing);
    if (wrong.length) this.notices.tell(`This page cannot use of the link: ${wrong.join(", ").slice(0, 200)}.`, "error");
    this.moved();
  }

  /** Make edits that a link has and the scene has not. */
  makeEdits(edits) {
    for (const { part, key, value } of edits) this.state.edit(part, key, value);
  }

  /** The address that leads back to what is shown. */
  get link() {
    return `${location.href.split("#")[0]}#${this.#fragment}`;
  }

  /** Camera, mode, bookmarks and edits as the link has them. */
  get #fragment() {
    const { mode } = this.#shown, edits = difference(this.state.original, this.state.scene, true);
    const words = new URLSearchParams();
    if (mode !== "shaded") words.set("mode", mode);
    for (const each of this.bookmarks.words) words.append(...each);
    if (edits.length || words.has("kept")) {
      words.set("scene", this.state.scene.name); // edits of one scene are none of another
      words.set("edits", JSON.stringify(edits));
    }
    return [this.camera.toFragment(), words.toString()].filter(Boolean).join("&");
  }

  /** The options of `texgs render` for the mode and the legend, which is not beside --compare. */
  get options() {
    const { mode, legend } = this.#shown;
    return `${OPTIONS[mode] ?? ` --mode ${mode}`}${legend && !OPTIONS[mode] ? " --legend" : ""}`;
  }

  /** The name of a mode, and what its colours mean. */
  words(mode) {
    return this.state.scene.volume && OF_VOLUME[mode] || MODES[mode];
  }

  #rest() {
    this.#resting = 0;
    if (this.#moving) this.renderer.draw(this.camera, this.state.scene, { moving: false, ...this.#shown });
    get("options").textContent = `texgs render ${this.camera.options(...this.renderer.size())}${this.options}`;
    try {
      history.replaceState(null, "", `#${this.#fragment}`);
    } catch {
      // a frame of another page may have no address of its own
    }
  }

  #inputs() {
    const mode = get("mode"), view = get("view"), fov = get("fov");
    mode.append(...this.renderer.modes.map((name) => new Option(this.words(name)[0], name)));
    mode.addEventListener("change", () => this.show({ mode: mode.value }));
    const [home, ...trained] = this.state.scene.views.map(({ name }) => new Option(capital(name), name));
    view.append(home, ...Object.keys(AXES).map((name) => new Option(`From ${name}`, name)));
    if (trained.length) view.append(element("optgroup", { label: "Training views" }, ...trained));
    view.addEventListener("change", () => {
      const { value } = view;
      if (value) this.goTo(value);
      view.value = this.#isLocked() ? "" : value;
    });
    fov.addEventListener("input", () => {
      if (this.#isLocked()) fov.value = this.camera.fov_y;
      else this.camera.place({ fov_y: Number(fov.value) });
      this.moved();
    });
  }
}
