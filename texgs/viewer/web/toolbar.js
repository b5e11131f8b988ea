// Undo, redo, comparison, picture, and saving; and the keys that do the same.

const get = (id) => document.getElementById(id);
const TYPED = ["text", "number"]; // inputs in which keys write

export class Toolbar {
  #page;

  constructor(page) {
    this.#page = page;
    get("undo").onclick = () => page.state.undo();
    get("redo").onclick = () => page.state.redo();
    get("before").onclick = () => this.#compare();
    get("still").onclick = () => this.#still();
    get("save").onclick = () => this.#askForName();
    get("save-dialog").addEventListener("close", () => this.#saveAsNamed());
    document.addEventListener("keydown", (event) => {
      if (!TYPED.includes(event.target.type) && this.#press(event)) event.preventDefault();
    });
    window.addEventListener("beforeunload", (event) => {
      if (!page.state.saved) event.preventDefault();
    });
    page.state.addEventListener("change", () => this.show());
    this.show();
  }

  /** Show the state as it is. */
  show() {
    const { past, future, saved, scene } = this.#page.state;
    for (const [id, verb, name] of [["undo", "Undo", past.at(-1)], ["redo", "Redo", future[0]]]) {
      const button = get(id);
      button.disabled = name === undefined;
      button.title = name === undefined ? `Nothing to ${id}` : `${verb}: ${name}`;
      button.setAttribute("aria-label", button.title);
    }
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

  /** Whether a key does something. */
  #press({ key, ctrlKey, metaKey, altKey, shiftKey }) {
    const { state } = this.#page, low = key.toLowerCase();
    if (document.querySelector("dialog[open]") || altKey) return false;
    if (!(ctrlKey || metaKey)) {
      if (low === "b") this.#compare();
      return low === "b";
    }
    if (low === "z" && !shiftKey) state.undo();
    else if (low === "y" || low === "z") state.redo();
    else if (low === "s") this.#askForName();
    else return false;
    return true;
  }

  #compare() {
    const before = !this.#page.shown.before;
    get("before").setAttribute("aria-pressed", before);
    this.#page.show({ before });
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
      const link = document.createElement("a");
      link.href = URL.createObjectURL(await answer.blob());
      link.download = `${state.file.replace(/\.ya?ml$/, "")}.png`;
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    } catch (error) {
      notices.tell(`No picture: ${error.message}`, "error");
    }
  }
}
