// The page of `texgs view`: a camera, the shared state of the scene, and the server's renderer.

import { Connection } from "./connection.js";
import { Notices } from "./notices.js";
import { Panel } from "./panel.js";
import { Remote } from "./remote.js";
import { ScenePage } from "./scene_page.js";
import { SegmentTool } from "./segment.js";
import { SharedState } from "./shared.js";
import { difference } from "./state.js";
import { Toolbar } from "./toolbar.js";

const get = (id) => document.getElementById(id);

class Page extends ScenePage {
  constructor(scene, connection, notices) {
    const renderer = new Remote(get("picture"), (text, level) => notices.tell(text, level));
    renderer.onframe = ({ ms, width, height }) => {
      get("pace").textContent = `${width} × ${height}, ${Math.round(ms)} ms`;
    };
    renderer.open(connection, scene);
    super(new SharedState(scene, connection), renderer, () => this.segments.isLocked);
    this.connection = connection;
    this.notices = notices;
    this.segments = new SegmentTool(this);
    this.panel = new Panel(this.state,
      { models: get("models"), background: get("background"), steps: get("steps") },
      { segment: (model) => this.segments.start(model), remove: (part) => this.state.remove(part) });
    this.toolbar = new Toolbar(this);
    this.follow();
  }

  /** Show what the server has now. One that was started again knows nothing of edits before. */
  adopt(message) {
    get("title").textContent = get("title").title = message.scene.name;
    const lost = this.run && this.run !== message.run ? difference(message.scene, this.state.scene) : [];
    this.run = message.run;
    this.state.adopt(message);
    if (!lost.length) return;
    this.notices.offer("The server was started again, without the edits of this page.", "Make them again", () => {
      for (const { part, key, value } of lost) this.state.edit(part, key, value);
    });
  }
}

const notices = new Notices(get("notices"));
const connection = new Connection(new URL("socket", location.href.replace(/^http/, "ws")));
let page = null;
connection.addEventListener("message", ({ detail }) => {
  if (detail.type === "scene") {
    page ??= new Page(detail.scene, connection, notices);
    page.adopt(detail);
  } else if (detail.level === "question") {
    page.toolbar.askToReplace(detail);
  } else if (detail.type === "notice") {
    notices.tell(detail.text, detail.level);
  }
});
connection.addEventListener("open", () => {
  notices.keep("");
  page?.state.restart();
});
connection.addEventListener("lost", () => notices.keep(
  "No connection to texgs view. This page tries again; start the same command if it has ended."));
