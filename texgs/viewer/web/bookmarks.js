// Views that are kept with the edits of the scene, to go back to and to make a film through: a part of the link.

import { element, replaceButtons } from "./inputs.js";
import { editsOf, numbersIn } from "./link.js";
import { difference, edited } from "./state.js";

const MOST = 20; // as the server has it
const KEYS = ["azimuth", "polar", "distance", "fov_y"];

/** A camera as a part of a link, and back; undefined where it is none. */
const packed = ({ pose }) => [...KEYS.map((key) => pose[key]), ...pose.target].map((x) => Number(x.toFixed(4))).join();

function unpacked(text) {
  const numbers = numbersIn(text, KEYS.length + 3);
  return numbers && { ...Object.fromEntries(KEYS.map((key, i) => [key, numbers[i]])), target: numbers.slice(-3) };
}

export class Bookmarks {
  kept = []; // {pose, scene}: a camera, and the scene with its edits as it was then
  #page; #keep;
  #again = []; // buttons that make edits of bookmarks again
  #list = element("ol", { "aria-label": "Bookmarks" });

  /** @param {ScenePage} page */
  constructor(page) {
    this.#page = page;
    const keep = () => this.#set([...this.kept, { pose: page.camera.pose, scene: page.state.scene }]);
    this.#keep = element("button", { type: "button", onclick: keep }, "Keep this view");
    document.getElementById("bookmarks").append(this.#keep, this.#list);
    page.state.addEventListener("change", () => this.#show());
  }

  /** Take those of a link, if it has any: with its edits, or `kept` ones. What is none is added to `wrong`. */
  follow(words, edits, wrong) {
    if (!words.has("bookmarks")) return;
    const { original, scene } = this.#page.state, poses = words.get("bookmarks").split(";").map(unpacked);
    const isOfAnother = (words.get("scene") ?? scene.name) !== scene.name;
    const own = isOfAnother ? [] : words.getAll("kept");
    const reset = difference(original, scene, true).map((edit) => ({ ...edit, value: null })).reduce(edited, scene);
    const unedited = difference(reset, original).reduce(edited, reset); // with all parts of now, segments too
    const editsAt = (i) => own[i] ? editsOf(own[i], unedited, wrong) : edits;
    const kept = poses.map((pose, i) => pose && { pose, scene: editsAt(i).reduce(edited, unedited) });
    if (poses.includes(undefined) || poses.length > MOST) wrong.push("bookmarks");
    this.#set(kept.filter(Boolean).slice(0, MOST));
  }

  /** As keys and values of a link; edits only where they are others than now. */
  get words() {
    const { original, scene: now } = this.#page.state, words = [["bookmarks", this.kept.map(packed).join(";")]];
    const isEdited = this.kept.some(({ scene }) => difference(now, scene).length);
    const edits = this.kept.map(({ scene }) => ["kept", JSON.stringify(difference(original, scene, true))]);
    return this.kept.length ? [...words, ...(isEdited ? edits : [])] : [];
  }

  #set(kept) {
    this.kept = kept;
    this.#keep.disabled = kept.length >= MOST;
    this.#again = kept.map((each, index) => this.#button(`Go to bookmark ${index + 1} and make its edits again`,
      { className: "edits", onclick: () => this.#restore(each) }, "Edits"));
    replaceButtons(this.#list, kept.map((each, index) => this.#item(each, index)));
    this.#show();
    this.#page.draw(); // which writes the link
  }

  /** Offer the edits that a bookmark was kept with, where others are made now. */
  #show() {
    for (const [i, { scene }] of this.kept.entries()) {
      const isOther = difference(this.#page.state.scene, scene).length > 0, button = this.#again[i];
      if (!isOther) button.remove();
      else if (!button.isConnected) this.#list.children[i].firstChild.after(button);
    }
  }

  /** Make the edits of a bookmark, and take others back. */
  #restore({ pose, scene }) {
    if (!this.#page.place(pose)) return;
    for (const { part, key, value } of difference(this.#page.state.scene, scene)) {
      this.#page.state.edit(part, key, value);
    }
  }

  #button(title, properties, text) {
    return element("button", { type: "button", title, "aria-label": title, ...properties }, text);
  }

  #item(kept, index) {
    const { pose } = kept, name = `azimuth ${Math.round(pose.azimuth)}°, polar ${Math.round(pose.polar)}°`;
    const go = element("button", { type: "button", onclick: () => this.#page.place(pose) }, name);
    const remove = () => this.#set(this.kept.filter((each) => each !== kept));
    const away = this.#button(`Remove bookmark ${index + 1}`, { className: "reset", onclick: remove }, "×");
    return element("li", {}, go, away);
  }
}
