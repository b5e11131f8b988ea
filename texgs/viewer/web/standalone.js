// The page of `texgs export --to scene.html`: camera, state and renderer of one scene, without a server.

import { EditHistory } from "./history.js";
import { download, toHex } from "./inputs.js";
import { Notices } from "./notices.js";
import { Panel } from "./panel.js";
import { ScenePage } from "./scene_page.js";
import { PictureDialog } from "./size_inputs.js";
import { State, difference } from "./state.js";
import { WebglRenderer } from "./webgl.js";

const get = (id) => document.getElementById(id);

class StandalonePage extends ScenePage {
  constructor(scene, renderer, notices) {
    super(new State(scene), renderer, notices);
    new Panel(this.state, { models: get("models"), background: get("background"), steps: get("steps") });
    new EditHistory(this);
    get("still").onclick = () => this.#save();
    new PictureDialog(this, (how) => this.#save(how));
    this.state.addEventListener("change", () => this.#tellWords());
    this.follow();
  }

  #tellWords() {
    const { original, scene } = this.state;
    const words = difference(original, scene).flatMap(wordsOf).map(quoted);
    get("words").hidden = !words.length;
    get("words").querySelector("textarea").value = words.join(" ");
  }

  /** Save a picture of the view, by default in the pixels of the screen. */
  #save(how) {
    const canvas = this.renderer.still(this.camera, this.state.scene, { ...this.shown, ...how });
    canvas.toBlob((blob) => download(blob, `${this.state.scene.name}.png`));
  }
}

/** An edit as `texgs edit` takes it. */
function wordsOf({ part, key, value }) {
  const place = part ? `${part}.${key}` : key;
  if (key === "light") return `light=${value ? `${value.azimuth},${value.polar}` : "headlight"}`;
  if (key === "cuts") {
    const planes = value.planes.map(({ normal, offset }) => `cut=${[...normal, offset]}`);
    const box = value.box ? [...value.box.low, ...value.box.high] : "";
    return ["cut=", ...planes, `cut.box=${box}`, `cut.faces=${value.faces}`];
  }
  return `${place}=${Array.isArray(value) ? toHex(value) : value ?? ""}`;
}

/** A word as a shell takes it. */
function quoted(word) {
  return /^[\w./#,=+-]*$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
}

async function start() {
  const scene = JSON.parse(get("scene").textContent), notices = new Notices(get("notices"));
  notices.keep("Unpacking the scene.");
  try {
    const renderer = new WebglRenderer(get("picture"), (text) => notices.keep(text));
    await renderer.open(get("surfels").textContent, scene);
    get("poster").hidden = true;
    get("picture").hidden = false;
    new StandalonePage(scene, renderer, notices);
    notices.keep("");
  } catch (error) {
    notices.keep(error.message);
    for (const each of document.querySelectorAll("button, input, select")) each.disabled = true;
  }
}

start();
