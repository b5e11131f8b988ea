// The page of `texgs export --to scene.html`: camera, state and renderer of one scene, without a server.

import { Compare } from "./compare.js";
import { EditHistory } from "./history.js";
import { download, element, toHex } from "./inputs.js";
import { Notices } from "./notices.js";
import { PageSlices } from "./page_slices.js";
import { Panel } from "./panel.js";
import { drawMarks } from "./picture_marks.js";
import { ScenePage } from "./scene_page.js";
import { PictureDialog } from "./size_inputs.js";
import { inFile } from "./space.js";
import { State, difference } from "./state.js";
import { TimeSlider } from "./time.js";
import { TransferEditor } from "./transfer.js";
import { OF_TWIN } from "./twin.js";
import { WebglRenderer } from "./webgl.js";

const get = (id) => document.getElementById(id);

class StandalonePage extends ScenePage {
  constructor(scene, renderer, notices) {
    super(new State(scene), renderer, notices);
    new Panel(this.state, { models: get("models"), background: get("background"), steps: get("steps") });
    new EditHistory(this);
    get("still").onclick = () => this.#save();
    new PictureDialog(this, (how) => this.#save(how));
    if (scene.held) this.time = new TimeSlider(this.state, get("time"), () => renderer.isBusy);
    if (scene.volume) {
      this.compare = new Compare(this);
      const source = new PageSlices(renderer.samples, this.state);
      this.addSlices(source);
      get("slices").append(element("p", { className: "hint" }, source.words));
      if (scene.transfer && Object.keys(scene.tfs).length) new TransferEditor(get("transfer"), this, scene.transfer, scene.presets);
    }
    this.state.addEventListener("change", () => {
      this.#tellWords();
      if (scene.volume) this.#limitModes();
    });
    this.follow();
  }

  /** Show something else; the volume in the page is that of the step with which it begins. */
  show(values) {
    const isNone = OF_TWIN.includes(values.mode ?? this.shown.mode) && this.#isElsewhere;
    if (isNone) this.notices.tell(`The volume in this page is that of step ${this.state.original.time}: go there to see it.`, "info");
    super.show(isNone ? { ...values, mode: "shaded" } : values);
  }

  get #isElsewhere() {
    return this.state.scene.time !== this.state.original.time;
  }

  #limitModes() {
    for (const option of get("mode").options) option.disabled = this.#isElsewhere && OF_TWIN.includes(option.value);
    if (OF_TWIN.includes(this.shown.mode)) this.show({});
  }

  #tellWords() {
    const { original, scene } = this.state, edits = difference(original, scene);
    const isFunctions = ({ key }) => key === "functions", words = edits.filter((edit) => !isFunctions(edit)).flatMap((edit) => wordsOf(edit, scene.space));
    tell("words", words.map(quoted).join(" "));
    if (scene.transfer) tell("functions", edits.filter(isFunctions).map(({ value }) => `functions: ${JSON.stringify(value)}`).join());
  }

  /** Save a picture of the view, by default in the pixels of the screen. */
  async #save(how) {
    try {
      const { before, legend } = this.shown, { original, scene } = this.state;
      const canvas = await this.renderer.still(this.camera, scene, { ...this.shown, ...how });
      drawMarks(canvas, before ? original : scene, this.camera, legend);
      const blob = await new Promise((done) => canvas.toBlob(done));
      if (!blob) throw new Error("This browser cannot make a picture of this size.");
      download(blob, `${this.state.scene.name}.png`);
    } catch (error) {
      this.notices.tell(error.message, "error");
    }
  }
}

/** Show a text to copy, if there is one. */
function tell(id, text) {
  get(id).hidden = !text;
  get(id).querySelector("textarea").value = text;
}

/** An edit as `texgs edit` takes it. */
function wordsOf({ part, key, value }, space) {
  const place = part ? `${part}.${key}` : key;
  if (key === "light") return `light=${value ? `${value.azimuth},${value.polar}` : "headlight"}`;
  if (key === "cuts") {
    const planes = value.planes.map(({ normal, offset }) => `cut=${[...normal, offset]}`);
    const box = value.box ? [...value.box.low, ...value.box.high] : "";
    const window = value.window ? [`cut.window=${value.window}`] : [];
    return ["cut=", ...planes, `cut.box=${box}`, `cut.faces=${value.faces}`, ...window];
  }
  if (key === "markers") {
    const words = ({ points, text }) => `${points.length > 1 ? "distance" : "marker"}=${text ? `${text}@` : ""}`
      + points.map((point) => inFile(point, space).map((x) => Number(x.toPrecision(9))).join()).join(":");
    return ["marker=none", ...value.map(words)];
  }
  return `${place}=${Array.isArray(value) ? toHex(value) : value ?? ""}`;
}

/** A word as a shell takes it. */
function quoted(word) {
  return /^[\w./#,=+:@-]*$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`;
}

async function start() {
  const scene = JSON.parse(get("scene").textContent), notices = new Notices(get("notices"));
  notices.keep("Unpacking the scene.");
  try {
    const renderer = new WebglRenderer(get("picture"), (text) => notices.keep(text));
    const steps = [...document.querySelectorAll(".step")].map((step) => step.textContent);
    await renderer.open(get("surfels").textContent, scene, get("volume")?.textContent, steps);
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
