// Picture and saving, beside the history.

import { EditHistory } from "./history.js";
import { FilmInputs } from "./film.js";
import { ask, download } from "./inputs.js";
import { PageInputs } from "./page_inputs.js";
import { PictureDialog } from "./size_inputs.js";

const EXPORTS = {
  mp4: "Film, MP4", gif: "Film, GIF", keys: "Keys of a film, YAML",
  html: "Web page", volume: "Web page with the volume, 2 MB more",
  "3dgs": "3D Gaussians, PLY", "2dgs": "2D Gaussians, PLY", points: "Points, PLY", mesh: "Mesh, PLY", textured: "Mesh with a texture, glTF",
  usd: "Splats with light, OpenUSD", gltf: "Splats with light, glTF", spz: "Splats with light, SPZ", vtp: "Surfels as polygons, VTK",
};
const get = (id) => document.getElementById(id);

export class Toolbar {
  #page; #film; #pageInputs;

  /**
   * @param {object} page - with camera, job, notices, renderer, shown and state
   * @param {{exports: string[]}} choices - what the server can write the scene as
   */
  constructor(page, { exports }) {
    this.#page = page;
    new EditHistory(page, { s: () => this.#askForName() });
    get("still").onclick = () => this.#still();
    new PictureDialog(page, (how) => this.#still(how));
    const kinds = [...exports.slice(0, 2), "keys", ...exports.slice(2)]; // behind films
    get("export-kind").append(...kinds.map((kind) => new Option(EXPORTS[kind] ?? kind, kind)));
    this.#film = new FilmInputs(page);
    this.#pageInputs = new PageInputs(page.state.scene);
    get("export").onclick = () => this.#export();
    get("save").onclick = () => this.#askForName();
    window.addEventListener("beforeunload", (event) => {
      if (!page.state.saved) event.preventDefault();
    });
    page.state.addEventListener("change", () => this.#show());
    this.#show();
  }

  #show() {
    const { saved, folder, title } = this.#page.state;
    get("save").classList.toggle("unsaved", !saved);
    get("save").setAttribute("aria-label", saved ? "Save; nothing is unsaved" : "Save; there are unsaved edits");
    document.title = `${saved ? "" : "• "}${title}`;
    get("title").textContent = get("title").title = title;
    get("save-folder").textContent = folder;
  }

  /** Ask before a file is replaced that is not this scene's. */
  askToReplace({ text, name }) {
    const dialog = get("replace-dialog");
    get("replace-text").textContent = text;
    dialog.returnValue = "";
    dialog.onclose = () => {
      if (dialog.returnValue === "replace") this.#page.state.save(name, true);
    };
    dialog.showModal();
  }

  async #askForName() {
    const name = await ask(get("save-dialog"), this.#page.state.file);
    if (name !== null) this.#page.state.save(name);
  }

  async #export() {
    this.#film.show();
    this.#pageInputs.show();
    const kind = await ask(get("export-dialog"), get("export-kind").value);
    if (kind === "keys") this.#film.save();
    if (kind === null || kind === "keys" || !this.#page.mayBegin()) return;
    const { size, ...film } = this.#film.values;
    this.#page.job.begin({ type: "export", kind, view: this.#view(size), ...film, ...this.#pageInputs.values });
  }

  /** What is shown, as the server has it. */
  #view(size = this.#page.renderer.size()) {
    const { camera, shown } = this.#page;
    return { camera: camera.wire(...size), ...shown };
  }

  /** Save a picture of the view, by default in the pixels of the screen. */
  async #still({ size, transparent = false } = {}) {
    const { notices, number, state } = this.#page, view = JSON.stringify({ ...this.#view(size), transparent });
    try {
      const answer = await fetch(`still.png?${new URLSearchParams({ view, page: number })}`);
      if (!answer.ok) throw new Error(await answer.text());
      download(await answer.blob(), `${state.file.replace(/\.ya?ml$/, "")}.png`);
    } catch (error) {
      notices.tell(`No picture: ${error.message}`, "error");
    }
  }
}
