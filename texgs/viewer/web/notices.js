// What the page tells: a few sentences that go away, and one on the connection that stays as long as it is true.

import { element } from "./inputs.js";

const SECONDS = { info: 5, error: 12 }; // others stay
const MOST = 4;

export class Notices {
  #root;
  #lasting = element("p", { className: "notice error", hidden: true });

  constructor(root) {
    this.#root = root;
    root.append(this.#lasting);
  }

  /** Tell something for a while; the same sentence is told once. Returns its element. */
  tell(text, level = "info") {
    const shown = [...this.#root.querySelectorAll(".passing")];
    shown.find((each) => each.dataset.text === text)?.remove();
    const going = shown.filter((each) => !each.classList.contains("offer"));
    if (going.length >= MOST) going[0].remove();
    const notice = element("p", { className: `notice passing ${level}` }, text);
    notice.dataset.text = text;
    notice.append(element("button", { "aria-label": "Close", onclick: () => notice.remove() }, "×"));
    this.#root.append(notice);
    if (SECONDS[level]) setTimeout(() => notice.remove(), 1000 * SECONDS[level]);
    return notice;
  }

  /** Tell something with a button that does something about it; it stays until one of its buttons is used. */
  offer(text, action, act) {
    const notice = this.tell(text, "offer");
    const button = element("button", { className: "main", onclick: () => { notice.remove(); act(); } }, action);
    notice.lastChild.before(button);
  }

  /** Tell something until it is another, or nothing. */
  keep(text) {
    this.#lasting.hidden = !text;
    this.#lasting.textContent = text;
  }
}
