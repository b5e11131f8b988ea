// The renderer on the server: asks for frames and shows them. The next one is asked for when the last is there, or
// at once in place of a whole one, which takes its time.

import { sizeOf } from "./size.js";

const LONGEST = 250; // milliseconds of a frame that count: the first one of a volume reads it

export class Remote {
  #canvas; #context; #notice; #connection;
  #asked = null; // id of the newest frame that is on its way
  #newest = 0; // id of the frame that was asked for last
  #wanted = null; // the newest view that was not asked for yet
  #latest = null; // the view that was asked for last, to ask again after a break
  #views = new Map(); // what frames on their way show, and when they were asked for, by their ids
  #count = 0;
  #shown = 0; // id of the frame on the canvas
  #picture = null; // that frame: where two are compared, the other one is to its right
  #wipe = 0.5; // part of the width that shows the first of two
  #isPair = false;
  #picks = new Map(); // what takes points that were asked for, by their ids

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {(text: string, level: string) => void} notice
   */
  constructor(canvas, notice) {
    this.#canvas = canvas;
    this.#context = canvas.getContext("2d", { alpha: false });
    this.#notice = notice;
    this.modes = [];
    this.took = 0; // milliseconds from asking to the latest frame of something that moves
    this.onframe = () => {}; // is called with the view that is on the canvas now, and what the server says about it
    this.onwait = () => {}; // is called with the view that is asked for, or null when it is there
    this.onrefused = () => {}; // is called with the reason why a frame could not be rendered
  }

  /** Show what comes by a connection. */
  async open(connection, scene) {
    this.#connection = connection;
    this.modes = scene.modes;
    connection.addEventListener("frame", ({ detail }) => this.#receive(detail));
    connection.addEventListener("message", ({ detail }) => {
      if (detail.type === "point") this.#take(detail);
      if (detail.frame === this.#asked) this.#refuse(detail.text);
      if (detail.frame === this.#asked || detail.refused) this.#next();
    });
    connection.addEventListener("open", () => {
      this.#wanted ??= this.#latest;
      this.#next();
    });
    connection.addEventListener("lost", () => {
      this.#asked = null;
      this.onwait(null);
    });
  }

  /** Size of the picture in pixels of the screen. */
  size() {
    return sizeOf(this.#canvas);
  }

  /** Ask for a frame; of those that cannot be asked for at once, the newest is. It stops a whole one on its way. */
  draw(camera, scene, { moving, mode = "shaded", before = false, only = "", gain = 1 }) {
    this.#wanted = { ...this.#view(camera, { mode, before, only, gain }), moving };
    this.#canvas.setAttribute("aria-busy", "true"); // until a whole frame is there
    if (this.#asked === null || !this.#latest.moving) this.#next();
  }

  /** The point of the scene [3] that a pixel shows; null for the background. */
  pointAt(camera, scene, shown, pixel) {
    const id = ++this.#count;
    this.#connection.send({ type: "pick", view: this.#view(camera, shown), pixel, id });
    return new Promise((resolve) => { this.#picks.set(id, resolve); });
  }

  /** Move the line between two pictures. */
  wipe(part) {
    this.#wipe = part;
    if (this.#picture) this.#paint();
  }

  /** Hand on a point; those that were asked for before it come no more. */
  #take({ id, point }) {
    this.#picks.get(id)?.(point);
    for (const each of this.#picks.keys()) if (each <= id) this.#picks.delete(each);
  }

  #view(camera, { mode, before, only, gain }) {
    return { camera: camera.wire(...this.size()), mode, before, only, gain };
  }

  #next() {
    this.#asked = null;
    if (!this.#wanted || !this.#connection?.isOpen) return;
    this.#latest = this.#wanted;
    this.#wanted = null;
    this.#asked = this.#newest = ++this.#count;
    this.#views.set(this.#asked, { ...this.#latest, at: performance.now() });
    this.#connection.send({ type: "view", id: this.#asked, ...this.#latest });
    this.onwait(this.#latest);
  }

  async #receive(data) {
    const length = new DataView(data).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
    const view = this.#arrived(header.id);
    try {
      const picture = await createImageBitmap(new Blob([new Uint8Array(data, 4 + length)]));
      if (header.id > this.#shown) this.#show(picture, view, header);
      else picture.close();
    } catch (error) {
      this.#notice(`A frame could not be shown: ${error.message}`, "error");
    }
  }

  /** The view of a frame that is there; those that were asked for before it come no more. */
  #arrived(id) {
    const view = this.#views.get(id);
    for (const each of this.#views.keys()) if (each <= id) this.#views.delete(each);
    if (view.moving) this.took = Math.min(LONGEST, performance.now() - view.at);
    if (id === this.#asked) {
      this.onwait(null);
      this.#next();
    }
    return view;
  }

  /** Show nothing: the frame before is none of what is asked for. */
  #refuse(why) {
    this.#canvas.classList.add("refused");
    this.#canvas.setAttribute("aria-busy", "false");
    this.onwait(null);
    this.onrefused(why);
  }

  #show(picture, view, header) {
    const canvas = this.#canvas, { camera: { width, height }, mode } = view, isPair = mode === "wipe";
    canvas.classList.remove("refused");
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    this.#picture?.close();
    this.#picture = picture;
    this.#isPair = isPair;
    this.#paint();
    this.#shown = header.id;
    if (!view.moving && header.id === this.#newest) canvas.setAttribute("aria-busy", "false");
    this.onframe(view, { ...header, width: picture.width / (isPair ? 2 : 1), height: picture.height });
  }

  #paint() {
    const { width, height } = this.#canvas, picture = this.#picture;
    const whole = picture.width / (this.#isPair ? 2 : 1), part = this.#isPair ? this.#wipe : 1;
    const paint = (left, from, to) => // the columns between two parts of the width
      this.#context.drawImage(picture, left + from * whole, 0, (to - from) * whole, picture.height,
        from * width, 0, (to - from) * width, height);
    paint(0, 0, part);
    paint(whole, part, 1);
  }
}
