// What a film is like: the way of its camera, whether edits move, its size, its length and its frames a second.

import { download, element } from "./inputs.js";
import { numberInput, sizeInputs } from "./size_inputs.js";
import { difference, partsOf } from "./state.js";

const KINDS = ["mp4", "gif", "keys"];
const TURN = 4; // keys of a turn: more than half of one between two would be the long way
const get = (id) => document.getElementById(id);

export class FilmInputs {
  #page;
  #size = sizeInputs();
  #seconds = numberInput("Length, seconds", { min: 0.1, max: 600, value: 4 });
  #fps = numberInput("Frames a second", { min: 1, max: 240, value: 25 });

  #way = element("select", {}, new Option("One turn", "turn"), new Option("Through the bookmarks", "bookmarks"),
    new Option("Bookmarks with their edits", "edits"));

  /** @param {ScenePage} page */
  constructor(page) {
    this.#page = page;
    const length = element("div", { className: "pair" }, this.#seconds.row, this.#fps.row);
    get("film").append(element("label", { className: "row" }, "Camera", this.#way), this.#size.row, length);
    get("export-kind").addEventListener("change", () => this.#hide());
  }

  /** Begin with the size on the screen. */
  show() {
    this.#size.show(this.#page.renderer.size());
    const isTurn = this.#page.bookmarks.kept.length < 2;
    for (const option of [...this.#way.options].slice(1)) option.disabled = isTurn;
    if (isTurn) this.#way.value = "turn";
    this.#hide();
  }

  get values() {
    if (get("film").disabled) return {};
    const { shown, state } = this.#page, keys = this.#keys(shown.before ? state.original : state.scene);
    return { size: this.#size.value, keys, fps: this.#fps.input.valueAsNumber };
  }

  /** Save the keys as a file, and say how the command line makes the film of them. */
  save() {
    const { fps, size: [width, height] } = this.values, { file, past, saved, scene: now } = this.#page.state;
    const name = file.replace(/(\.ya?ml)?$/, "-keys.yaml");
    download(new Blob(this.#keys(now).map((key) => `- ${JSON.stringify(key)}\n`)), name);
    const options = `--width ${width} --height ${height} --fps ${fps}${this.#page.options}`;
    const first = saved ? "" : " Save the scene first.";
    const scene = past.length ? file : "SCENE"; // as it was opened, wherever that is
    this.#page.notices.tell(`This film again: texgs render ${scene} --film ${name} ${options}.${first}`, "info");
  }

  /** Keys as `texgs render --film` has them, evenly over all frames; edits are those since a scene or the key before. */
  #keys(start) {
    const { camera, state, bookmarks } = this.#page, parts = partsOf(state.scene), fps = this.#fps.input.valueAsNumber;
    const way = this.#way.value, stops = way === "turn" ? Array(TURN).fill({ pose: camera.pose }) : bookmarks.kept;
    const count = Math.max(stops.length, Math.round(this.#seconds.input.valueAsNumber * fps)); // one a key at least
    const at = stops.map((_, i) => Math.round(i * (count - 1) / (stops.length - 1)));
    const isThere = ({ part }) => part === "" || parts.has(part); // a segment may be gone again
    let before = start;
    return stops.map(({ pose: { azimuth, polar, distance: radius, fov_y, target }, scene }, i) => {
      const turned = way === "turn" ? azimuth + 360 * at[i] / count : azimuth, edits = [];
      if (way === "edits") {
        const changed = difference(before, scene).filter(isThere);
        edits.push(...changed.map(({ part, key, value }) => [part ? `${part}.${key}` : key, value]));
        before = scene;
      }
      const seconds = i < at.length - 1 ? { seconds: (at[i + 1] - at[i]) / fps } : {};
      return { azimuth: turned, polar, radius, fov_y, target, ...seconds, ...Object.fromEntries(edits) };
    });
  }

  /** What is no film has no inputs that a form could require. */
  #hide() {
    get("film").hidden = get("film").disabled = !KINDS.includes(get("export-kind").value);
  }
}
