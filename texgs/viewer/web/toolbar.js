// Picture and saving, beside the history.

import { EditHistory } from "./history.js";
import { download } from "./inputs.js";

const get = (id) => document.getElementById(id);

export class Toolbar {
  #page;

  constructor(page) {
    this.#page = page;
    new EditHistory(page, { s: () => this.#askForName() });
    get("still").onclick = () => this.#still();
    get("save").onclick = () => this.#askForName();
    get("save-dialog").addEventListener("close", () => this.#saveAsNamed());
    window.addEventListener("beforeunload", (event) => {
      if (!page.state.saved) event.preventDefault();
    });
    page.state.addEventListener("change", () => this.#show());
    this.#show();
  }

  #show() {
    const { saved, scene } = this.#page.state;
    get("save").classList.toggle("unsaved", !saved);
    get("save").setAttribute("aria-label", saved ? "Save; nothing is unsaved" : "Save; there are unsaved edits");
    document.title = `${saved ? "" : "• "}${scene.name}`;
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

  #askForName() {
    get("save-name").value = this.#page.state.file;
    get("save-dialog").returnValue = "";
    get("save-dialog").showModal();
    get("save-name").select();
  }

  #saveAsNamed() {
    if (get("save-dialog").returnValue === "save") this.#page.state.save(get("save-name").value);
  }

  /** Save a picture of the view, in the pixels of the screen. */
  async #still() {
    const { camera, renderer, shown, notices, state } = this.#page;
    const view = JSON.stringify({ camera: camera.wire(...renderer.size()), ...shown });
    try {
      const answer = await fetch(`still.png?${new URLSearchParams({ view })}`);
      if (!answer.ok) throw new Error(await answer.text());
      download(await answer.blob(), `${state.file.replace(/\.ya?ml$/, "")}.png`);
    } catch (error) {
      notices.tell(`No picture: ${error.message}`, "error");
    }
  }
}
