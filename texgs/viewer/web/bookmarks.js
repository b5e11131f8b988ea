// Cameras that are kept, to go back to and to make a film through. They are a part of the page's link.

import { element, replaceButtons } from "./inputs.js";
import { numbersIn } from "./link.js";

const MOST = 20; // as the server has it
const KEYS = ["azimuth", "polar", "distance", "fov_y"];

/** A camera as a part of a link, and back; undefined where it is none. */
const packed = (pose) => [...KEYS.map((key) => pose[key]), ...pose.target].map((x) => Number(x.toFixed(4))).join();

function unpacked(text) {
  const numbers = numbersIn(text, KEYS.length + 3);
  return numbers && { ...Object.fromEntries(KEYS.map((key, i) => [key, numbers[i]])), target: numbers.slice(-3) };
}

export class Bookmarks {
  poses = []; // of cameras
  #page; #keep;
  #list = element("ol", { "aria-label": "Bookmarks" });

  /** @param {ScenePage} page */
  constructor(page) {
    this.#page = page;
    this.#keep = element("button", { type: "button", onclick: () => this.#set([...this.poses, page.camera.pose]) },
      "Keep this view");
    document.getElementById("bookmarks").append(this.#keep, this.#list);
  }

  /** Take those of a link, if it has any; what is none is added to `wrong`. */
  follow(words, wrong) {
    if (!words.has("bookmarks")) return;
    const poses = words.get("bookmarks").split(";").map(unpacked);
    if (poses.includes(undefined) || poses.length > MOST) wrong.push("bookmarks");
    this.#set(poses.filter(Boolean).slice(0, MOST));
  }

  /** As a part of a link. */
  get words() {
    return this.poses.map(packed).join(";");
  }

  #set(poses) {
    this.poses = poses;
    this.#keep.disabled = poses.length >= MOST;
    replaceButtons(this.#list, poses.map((pose, index) => this.#item(pose, index)));
    this.#page.draw(); // which writes the link
  }

  #item(pose, index) {
    const name = `azimuth ${Math.round(pose.azimuth)}°, polar ${Math.round(pose.polar)}°`;
    const go = element("button", { type: "button", onclick: () => this.#page.place(pose) }, name);
    const remove = () => this.#set(this.poses.filter((each) => each !== pose));
    const title = `Remove bookmark ${index + 1}`;
    return element("li", {}, go, element("button",
      { type: "button", className: "reset", title, "aria-label": title, onclick: remove }, "×"));
  }
}
