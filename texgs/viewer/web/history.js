// Undo, redo and comparison with the scene as it was, and the keys that do the same.

const get = (id) => document.getElementById(id);
const TYPED = ["text", "number", "textarea"]; // inputs in which keys write

export class EditHistory {
  #page;
  #held; // what letters do with Ctrl

  /**
   * @param {ScenePage} page
   * @param {object} held - functions by letters that are pressed with Ctrl, beside those of undo and redo
   */
  constructor(page, held = {}) {
    this.#page = page;
    this.#held = held;
    get("undo").onclick = () => page.state.undo();
    get("redo").onclick = () => page.state.redo();
    get("before").onclick = () => this.#compare();
    document.addEventListener("keydown", (event) => {
      if (this.#press(event, TYPED.includes(event.target.type))) event.preventDefault();
    });
    page.state.addEventListener("change", () => this.#show());
    this.#show();
  }

  #show() {
    const { past, future } = this.#page.state;
    for (const [id, verb, name] of [["undo", "Undo", past.at(-1)], ["redo", "Redo", future[0]]]) {
      const button = get(id);
      button.disabled = name === undefined;
      button.title = name === undefined ? `Nothing to ${id}` : `${verb}: ${name}`;
      button.setAttribute("aria-label", button.title);
    }
  }

  /** Whether a key does something; while somebody types, only what is held does. */
  #press({ key, ctrlKey, metaKey, altKey, shiftKey }, isTyping) {
    const { state } = this.#page, low = (key ?? "").toLowerCase(); // filling in may send none
    if (document.querySelector("dialog[open]") || altKey) return false;
    if ((ctrlKey || metaKey) && low in this.#held) {
      this.#held[low]();
      return true;
    }
    if (isTyping) return false;
    if (!(ctrlKey || metaKey)) {
      if (low === "b") this.#compare();
      return low === "b";
    }
    if (low === "z" && !shiftKey) state.undo();
    else if (low === "y" || low === "z") state.redo();
    else return false;
    return true;
  }

  #compare() {
    this.#page.show({ before: !this.#page.shown.before });
  }
}
