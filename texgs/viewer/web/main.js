// The page of `texgs view`: a camera, the shared state of the scene, and the server's renderer.

import { AXES, OrbitCamera } from "./camera.js";
import { Connection } from "./connection.js";
import { control } from "./controls.js";
import { capital } from "./inputs.js";
import { LightControl } from "./light.js";
import { Notices } from "./notices.js";
import { Panel } from "./panel.js";
import { Remote } from "./remote.js";
import { SegmentTool } from "./segment.js";
import { SharedState } from "./shared.js";
import { difference } from "./state.js";
import { Toolbar } from "./toolbar.js";

const REST = 100; // milliseconds after the last movement until a whole frame is asked for
const NAMES = {
  shaded: "Shaded", unshaded: "Without light", normal: "Normals", depth: "Depth", alpha: "Opacity",
  ambient: "Ambient factor", diffuse: "Diffuse factor", specular: "Specular factor", shininess: "Shininess",
};
const get = (id) => document.getElementById(id);

class Page {
  #resting = 0; // timer
  #shown = { mode: "shaded", before: false, only: "" };

  constructor(scene, connection, notices) {
    this.canvas = get("picture");
    this.connection = connection;
    this.notices = notices;
    this.state = new SharedState(scene, connection);
    this.camera = new OrbitCamera(scene);
    this.renderer = new Remote(this.canvas, (text, level) => notices.tell(text, level));
    this.renderer.onframe = ({ ms, width, height }) => {
      get("pace").textContent = `${width} × ${height}, ${Math.round(ms)} ms`;
    };
    this.renderer.open(connection, scene);
    this.#views(scene);
    this.segments = new SegmentTool(this);
    this.panel = new Panel(this.state,
      { models: get("models"), background: get("background"), steps: get("steps") },
      { segment: (model) => this.segments.start(model), remove: (part) => this.state.remove(part) });
    this.light = new LightControl(get("light"), this.state, this.camera);
    this.toolbar = new Toolbar(this);
    control(this.canvas, () => this.camera, () => this.moved(), (name) => this.goTo(name),
      () => this.segments.isLocked);
    this.state.addEventListener("change", () => this.draw(true));
    new ResizeObserver(() => this.draw(true)).observe(this.canvas);
    window.addEventListener("hashchange", () => this.#follow());
    this.#follow();
  }

  /** Ask for a frame; while something moves, for a fast one now and a whole one at rest. */
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

  /** Show something else of the scene: `mode`, how it was `before`, or `only` one model. */
  show(values) {
    Object.assign(this.#shown, values);
    get("mode").value = this.#shown.mode;
    get("badge").hidden = !this.#shown.before;
    this.draw();
  }

  get shown() {
    return this.#shown;
  }

  /** Go to a named view: "home", an axis, or one of the scene's. */
  goTo(name) {
    if (this.segments.isLocked) return;
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

  /** Show what the server has now. One that was started again knows nothing of edits before. */
  adopt(message) {
    get("title").textContent = get("title").title = message.scene.name;
    const lost = this.run && this.run !== message.run ? difference(message.scene, this.state.scene) : [];
    this.run = message.run;
    this.state.adopt(message);
    if (!lost.length) return;
    this.notices.offer("The server was started again, without the edits of this page.", "Make them again", () => {
      for (const { part, key, value } of lost) this.state.edit(part, key, value);
    });
  }

  #rest(moving) {
    if (moving) this.renderer.draw(this.camera, this.state.scene, { moving: false, ...this.#shown });
    const { mode } = this.#shown;
    history.replaceState(null, "", `#${this.camera.toFragment()}${mode === "shaded" ? "" : `&mode=${mode}`}`);
  }

  /** Go where the link says. */
  #follow() {
    const fragment = location.hash.slice(1), mode = new URLSearchParams(fragment).get("mode");
    this.camera.goHome(this.canvas.clientWidth, this.canvas.clientHeight);
    this.camera.fromFragment(fragment);
    if (this.renderer.modes.includes(mode)) this.show({ mode });
    this.moved();
  }

  #views(scene) {
    const mode = get("mode"), view = get("view"), fov = get("fov");
    mode.append(...this.renderer.modes.map((name) => new Option(NAMES[name] ?? name, name)));
    mode.addEventListener("change", () => this.show({ mode: mode.value }));
    const names = [...scene.views.map((each) => each.name), ...Object.keys(AXES)];
    view.append(...names.map((name) => new Option(AXES[name] ? `From ${name}` : capital(name), name)));
    view.addEventListener("change", () => {
      const { value } = view;
      if (value) this.goTo(value);
      view.value = value;
    });
    fov.addEventListener("input", () => {
      if (this.segments.isLocked) return;
      this.camera.place({ fov_y: Number(fov.value) });
      this.moved();
    });
  }
}

const notices = new Notices(get("notices"));
const connection = new Connection(new URL("socket", location.href.replace(/^http/, "ws")));
let page = null;
connection.addEventListener("message", ({ detail }) => {
  if (detail.type === "scene") {
    page ??= new Page(detail.scene, connection, notices);
    page.adopt(detail);
  } else if (detail.level === "question") {
    page.toolbar.askToReplace(detail);
  } else if (detail.type === "notice") {
    notices.tell(detail.text, detail.level);
  }
});
connection.addEventListener("open", () => {
  notices.keep("");
  page?.state.restart();
});
connection.addEventListener("lost", () => notices.keep(
  "No connection to texgs view. This page tries again; start the same command if it has ended."));
