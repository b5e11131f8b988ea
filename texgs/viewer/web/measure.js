// Marks points of the scene and distances between two, by clicks; and lists those that there are.

import { pointBelow } from "./center.js";
import { element, replaceButtons } from "./inputs.js";
import { lengthOf } from "./space.js";

const MOST = 100, LONGEST = 200; // markers, and letters of a text, as the server has it
const STILL = 4; // CSS pixels that a click may move
const TOOLS = {
  distance: ["Measure", "Click on both ends of the distance, in the picture or on a slice."],
  marker: ["Mark a point", "Click on the point, in the picture or on a slice; then write beside it."],
};

export class Measure {
  begun = null; // the first point of a distance
  #page; #tool = ""; // of TOOLS; none: clicks are nothing
  #isLocked; #waiting = 0; // number of the latest turn of the tool: points that come later are none of it
  #hint = element("p", { role: "status", className: "hint" });
  #list = element("ul", { "aria-label": "Markers" });
  #clear = element("button", { type: "button", onclick: () => this.#set([]) }, "Remove all");
  #buttons;

  /**
   * @param {ScenePage} page
   * @param {() => boolean} isLocked - whether clicks on the picture do something else
   */
  constructor(page, isLocked) {
    this.#page = page;
    this.#isLocked = isLocked;
    this.#buttons = Object.entries(TOOLS).map(([tool, [name]]) => element("button",
      { type: "button", "aria-pressed": false, onclick: () => this.turn(this.#tool === tool ? "" : tool) }, name));
    const tools = element("div", { className: "tools" }, ...this.#buttons, this.#clear);
    document.getElementById("markers").append(tools, this.#hint, this.#list);
    const { canvas, state } = page;
    let down = null;
    canvas.addEventListener("pointerdown", (event) => { down = event; });
    canvas.addEventListener("click", (event) => {
      const moved = down ? Math.hypot(event.clientX - down.clientX, event.clientY - down.clientY) : 0;
      if (moved < STILL) this.#pick(event);
    });
    canvas.addEventListener("keydown", ({ key }) => {
      if (key === "Escape") this.turn("");
      if (key === "Enter") this.#pick({ offsetX: canvas.clientWidth / 2, offsetY: canvas.clientHeight / 2 });
    });
    state.addEventListener("change", () => this.#show());
    this.#show();
  }

  /** Whether clicks are its points. */
  get isOn() {
    return this.#tool !== "";
  }

  /** Begin with "distance" or "marker", or end with "". */
  turn(tool) {
    this.#tool = tool;
    this.#waiting += 1;
    this.begun = null;
    this.#page.canvas.classList.toggle("measuring", this.isOn);
    this.#show();
    this.#page.draw();
  }

  /** Take a point of the world [3] for the tool: one of a slice, or of the picture. */
  click(point) {
    if (!this.isOn) return;
    if (this.#tool === "marker" || this.begun) {
      this.#add([...(this.begun ? [this.begun] : []), point]);
    } else {
      this.begun = point;
      this.#page.draw();
    }
  }

  async #pick(event) {
    const { isOfCamera, notices, shown } = this.#page, turn = this.#waiting;
    if (!this.isOn || !isOfCamera || shown.only || this.#isLocked() || event.detail > 1) return; // a double click is one
    const point = await pointBelow(this.#page, event);
    if (turn !== this.#waiting) return;
    if (point) this.click(point);
    else notices.tell("There is only background. Click on the scene to mark a point.");
  }

  get #markers() {
    return this.#page.state.scene.markers;
  }

  #add(points) {
    this.begun = null;
    if (this.#markers.length >= MOST) this.#page.notices.tell(`A scene has at most ${MOST} markers.`);
    else this.#set([...this.#markers, { points, text: "" }]);
    if (this.#tool === "marker") this.#list.querySelector("li:last-child input")?.focus();
  }

  #set(markers) {
    this.#page.state.edit("", "markers", markers);
  }

  #show() {
    Object.keys(TOOLS).forEach((tool, i) => this.#buttons[i].setAttribute("aria-pressed", tool === this.#tool));
    this.#hint.textContent = TOOLS[this.#tool]?.[1] ?? "";
    this.#clear.hidden = !this.#markers.length;
    const items = this.#list.children;
    if (items.length !== this.#markers.length) {
      replaceButtons(this.#list, this.#markers.map((_, index) => this.#item(index)));
    }
    this.#markers.forEach((marker, index) => {
      const [input, length] = items[index].children;
      if (input !== document.activeElement) input.value = marker.text;
      length.textContent = lengthOf(marker, this.#page.state.scene.space);
    });
  }

  #item(index) {
    const write = ({ target }) => this.#set(this.#markers.map((each, i) => i === index
      ? { ...each, text: target.value.trim() } : each));
    const input = element("input", { maxLength: LONGEST, onchange: write, placeholder: "Text",
      "aria-label": `Text of marker ${index + 1}` });
    const title = `Remove marker ${index + 1}`, remove = () => this.#set(this.#markers.toSpliced(index, 1));
    return element("li", {}, input, element("span"), element("button",
      { type: "button", className: "reset", title, "aria-label": title, onclick: remove }, "×"));
  }
}
