// The page of `texgs export --to scene.html`: camera, state and renderer of one scene, without a server.

import { AXES, OrbitCamera } from "./camera.js";
import { control } from "./controls.js";
import { capital, element, toHex } from "./inputs.js";
import { LightControl } from "./light.js";
import { Notices } from "./notices.js";
import { Panel } from "./panel.js";
import { State, difference } from "./state.js";
import { WebglRenderer } from "./webgl.js";

const REST = 150; // milliseconds after the last movement until a frame is drawn in full
const get = (id) => document.getElementById(id);

class StandalonePage {
  #resting = 0; // timer
  #shown = { mode: "shaded", before: false };

  constructor(scene, renderer) {
    this.canvas = get("picture");
    this.state = new State(scene);
    this.camera = new OrbitCamera(scene);
    this.renderer = renderer;
    new Panel(this.state, { models: get("models"), background: get("background"), steps: get("steps") });
    this.light = new LightControl(get("light"), this.state, this.camera);
    this.#views();
    this.#tools();
    control(this.canvas, () => this.camera, () => this.moved(), (name) => this.goTo(name));
    this.state.addEventListener("change", () => this.#edited());
    new ResizeObserver(() => this.draw()).observe(this.canvas);
    window.addEventListener("hashchange", () => this.#follow());
    this.#follow();
  }

  /** Draw a frame; while something moves, perhaps a coarse one now and a whole one at rest. */
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

  /** Go to a named view: "home" or an axis. */
  goTo(name) {
    const { clientWidth, clientHeight } = this.canvas;
    if (AXES[name]) {
      const [azimuth, polar] = AXES[name];
      this.camera.place({ azimuth, polar, target: this.camera.home.target });
    } else {
      this.camera.goHome(clientWidth, clientHeight);
    }
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

  /** Go where the link says. */
  #follow() {
    const fragment = location.hash.slice(1), mode = new URLSearchParams(fragment).get("mode");
    this.camera.goHome(this.canvas.clientWidth, this.canvas.clientHeight);
    this.camera.fromFragment(fragment);
    if (this.renderer.modes.includes(mode)) get("mode").value = this.#shown.mode = mode;
    this.moved();
  }

  #views() {
    const mode = get("mode"), view = get("view"), fov = get("fov");
    mode.append(...this.renderer.modes.map((name) => new Option(capital(name), name)));
    mode.onchange = () => {
      this.#shown.mode = mode.value;
      this.draw();
    };
    view.append(...["home", ...Object.keys(AXES)].map((name) =>
      new Option(AXES[name] ? `From ${name}` : capital(name), name)));
    view.onchange = () => {
      const { value } = view;
      if (value) this.goTo(value);
      view.value = value;
    };
    fov.oninput = () => {
      this.camera.place({ fov_y: Number(fov.value) });
      this.moved();
    };
  }

  // ---- Tools ----

  #tools() {
    get("undo").onclick = () => this.state.undo();
    get("redo").onclick = () => this.state.redo();
    get("before").onclick = () => this.#compare();
    get("still").onclick = () => this.#save();
    document.addEventListener("keydown", (event) => {
      if (!["text", "number", "textarea"].includes(event.target.type) && this.#press(event)) event.preventDefault();
    });
  }

  /** Whether a key does something. */
  #press({ key, ctrlKey, metaKey, altKey, shiftKey }) {
    const isHeld = ctrlKey || metaKey, low = key.toLowerCase();
    if (altKey) return false;
    if (low === "b" && !isHeld) this.#compare();
    else if (low === "z" && isHeld && !shiftKey) this.state.undo();
    else if (isHeld && (low === "y" || low === "z")) this.state.redo();
    else return false;
    return true;
  }

  #compare() {
    this.#shown.before = !this.#shown.before;
    get("before").setAttribute("aria-pressed", this.#shown.before);
    get("badge").hidden = !this.#shown.before;
    this.draw();
  }

  #edited() {
    const { past, future, original, scene } = this.state;
    for (const [id, verb, name] of [["undo", "Undo", past.at(-1)], ["redo", "Redo", future[0]]]) {
      get(id).disabled = name === undefined;
      get(id).title = name === undefined ? `Nothing to ${id}` : `${verb}: ${name}`;
    }
    const words = difference(original, scene).map(wordOf);
    get("words").hidden = !words.length;
    get("words").querySelector("textarea").value = words.join(" ");
    this.draw(true);
  }

  /** Save a picture of the view, in the pixels of the screen. */
  #save() {
    const canvas = this.renderer.still(this.camera, this.state.scene, this.#shown);
    canvas.toBlob((blob) => {
      const link = element("a", { href: URL.createObjectURL(blob), download: `${this.state.scene.name}.png` });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    });
  }
}

/** An edit as `texgs edit` takes it. */
function wordOf({ part, key, value }) {
  const place = part ? `${part}.${key}` : key;
  if (key === "light") return `light=${value ? `${value.azimuth},${value.polar}` : "headlight"}`;
  return `${place}=${Array.isArray(value) ? toHex(value) : value ?? ""}`;
}

async function start() {
  const scene = JSON.parse(get("scene").textContent), notices = new Notices(get("notices"));
  notices.keep("Unpacking the scene.");
  try {
    const renderer = new WebglRenderer(get("picture"), (text) => notices.keep(text));
    await renderer.open(get("surfels").textContent, scene);
    get("poster").hidden = true;
    get("picture").hidden = false;
    new StandalonePage(scene, renderer);
    notices.keep("");
  } catch (error) {
    notices.keep(error.message);
  }
}

start();
