// The page of `texgs view`: a camera, the shared state of the scene, and the server's renderer.

import { Compare } from "./compare.js";
import { Connection } from "./connection.js";
import { ask, save } from "./inputs.js";
import { Job } from "./job.js";
import { LookTool } from "./look.js";
import { Notices } from "./notices.js";
import { Panel } from "./panel.js";
import { Remote } from "./remote.js";
import { remoteSlices } from "./remote_slices.js";
import { ScenePage } from "./scene_page.js";
import { SegmentTool } from "./segment.js";
import { SharedState } from "./shared.js";
import { difference } from "./state.js";
import { TimeSlider } from "./time.js";
import { Toolbar } from "./toolbar.js";
import { TransferEditor } from "./transfer.js";

const PATIENCE = 300; // milliseconds until the page says that it waits for a frame
const get = (id) => document.getElementById(id);

class Page extends ScenePage {
  constructor(greeting, connection, notices) {
    const { scene, choices, run } = greeting;
    const renderer = new Remote(get("picture"), (text, level) => notices.tell(text, level));
    renderer.onrefused = (why) => {
      get("refused").textContent = why;
      get("pace").textContent = "";
      this.compare?.tell({});
    };
    renderer.open(connection, scene);
    super(new SharedState(greeting, connection), renderer, notices, () => this.segments.isLocked);
    renderer.onwait = (view) => this.#wait(view);
    this.run = run;
    this.number = greeting.page;
    this.connection = connection;
    this.job = new Job(connection);
    this.segments = new SegmentTool(this);
    this.looks = new LookTool(this, choices);
    this.panel = new Panel(this.state,
      { models: get("models"), background: get("background"), steps: get("steps") },
      { segment: (model) => this.#segment(model), look: (part) => this.beginLook(part),
        rename: (part) => this.#rename(part), remove: (part) => this.state.remove(part) });
    this.time = new TimeSlider(this.state, get("time"), () => this.state.isPending);
    this.compare = new Compare(this);
    this.toolbar = new Toolbar(this, choices);
    const hasFunctions = scene.transfer && Object.keys(scene.tfs).length > 0;
    get("transfer-section").hidden = !hasFunctions;
    if (hasFunctions) new TransferEditor(get("transfer"), this, scene.transfer, choices.presets);
    if (scene.slices) this.addSlices(remoteSlices(scene.slices));
    get("look-start").onclick = () => this.beginLook();
    get("look-start").disabled = !scene.models.some((model) => model.can.includes("look"));
    this.follow();
  }

  draw(moving) {
    super.draw(moving);
    this.looks?.paint();
  }

  framed(view, { ms, width, height, ...scores }) {
    super.framed(view);
    get("pace").textContent = `${this.words(view.mode)[0]}, ${width} × ${height}, ${Math.round(ms)} ms`;
    get("refused").textContent = "";
    this.compare?.tell(scores);
  }

  /** Say after a moment what is being drawn; null: nothing. */
  #wait(view) {
    clearTimeout(this.waiting);
    get("drawing").hidden = true;
    if (view) this.waiting = setTimeout(() => this.#tellDrawing(view.mode), PATIENCE);
  }

  #tellDrawing(mode) {
    get("drawing").textContent = `Drawing: ${this.words(mode)[0]}`;
    get("drawing").hidden = false;
  }

  #segment(model) {
    if (!this.mayBegin()) return;
    this.looks.leave();
    this.measure.turn("");
    this.segments.start(model);
  }

  /** Choose a new look for a part, or for all. */
  beginLook(part) {
    if (get("look-start").disabled || !this.mayBegin()) return;
    this.segments.leave();
    this.looks.start(part);
  }

  /** Whether nothing is being made here; says so where something is. */
  mayBegin() {
    if (this.job.isAtWork) this.notices.tell("Something is being made: wait for it, or cancel it.", "info");
    return !this.job.isAtWork;
  }

  async #rename(part) {
    const [, name] = part.match(/([^/]*)$/), given = await ask(get("rename-dialog"), name);
    if (given !== null && given !== name) this.state.rename(part, given);
  }

  /** Offer to make edits again that a server does not know which was started again. */
  #offerAgain(lost) {
    const said = "The server was started again, without the edits of this page. "
      + "New segments and looks come back with a scene that was saved: open its file.";
    const { scene } = this.state;
    this.notices.offer(said, "Make the other edits again", () => {
      const newer = difference(scene, this.state.scene).map(({ part, key }) => `${part} ${key}`);
      super.makeEdits(lost.filter(({ part, key }) => !newer.includes(`${part} ${key}`)));
    });
  }

  /** Ask first, where other steps are there: all pages share them. */
  makeEdits(edits) {
    const { past, future } = this.state, make = () => super.makeEdits(edits);
    const [some, them] = edits.length === 1 ? ["1 other edit", "it"] : [`${edits.length} other edits`, "them"];
    if (!past.length && !future.length) make();
    else this.notices.offer(`The link has ${some} of this scene.`, `Make ${them} on all pages`, make);
  }

  /** Show what the server has now. One that was started again knows nothing of edits before. */
  adopt(message) {
    const isAnother = message.run && message.run !== this.run;
    if (isAnother && message.scene.name !== this.state.scene.name) {
      location.replace(location.pathname); // nothing of this page is of the other scene
      return;
    }
    if (isAnother) this.state.original = message.original;
    const lost = isAnother ? difference(message.scene, this.state.scene) : [];
    this.run = message.run ?? this.run;
    this.number = message.page ?? this.number;
    this.state.adopt(message);
    if (lost.length) this.#offerAgain(lost);
  }
}

const notices = new Notices(get("notices"));
const connection = new Connection(new URL("socket", location.href.replace(/^http/, "ws")));
let page = null;
connection.addEventListener("message", ({ detail }) => {
  if (detail.type === "scene") {
    notices.keep("");
    if (page) page.adopt(detail);
    else page = new Page(detail, connection, notices);
  } else if (detail.level === "question") {
    page.toolbar.askToReplace(detail);
  } else if (detail.level === "file") {
    notices.tell(detail.text, "info");
    save(`files/${encodeURIComponent(detail.name)}`, detail.name);
  } else if (detail.type === "notice" && detail.frame === undefined) { // else the picture says it
    notices.tell(detail.text, detail.level);
  }
});
connection.addEventListener("open", () => {
  const said = "The connection broke before all edits had arrived: Steps lists those that have.";
  if (page?.state.isPending) notices.tell(said, "error stays");
  page?.state.restart();
});
connection.addEventListener("unsent", () => notices.tell("Not done: there is no connection to texgs view.", "error"));
connection.addEventListener("lost", ({ detail: why }) => { // before the page's job hears of it
  if (page?.job.isAtWork) notices.tell("The connection broke, which cancelled what was being made.", "error stays");
  const gone = "No connection to texgs view. This page tries again; start the same command if it has ended.";
  notices.keep(why || gone);
});
