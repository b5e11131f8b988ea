// The renderer on the server: asks for frames and shows them. The next one is asked for when the last is there.

import { sizeOf } from "./size.js";

export class Remote {
  #canvas; #context; #notice; #connection;
  #asked = null; // id of the frame that is on its way
  #wanted = null; // the newest view that was not asked for yet
  #latest = null; // the view that was asked for last, to ask again after a break
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
    this.onframe = () => {}; // is called with what the server says about a frame that is shown
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
    connection.addEventListener("lost", () => { this.#asked = null; });
  }

  /** Size of the picture in pixels of the screen. */
  size() {
    return sizeOf(this.#canvas);
  }

  /** Ask for a frame; of those that cannot be asked for at once, the newest is. */
  draw(camera, scene, { moving, mode = "shaded", before = false, only = "", gain = 1 }) {
    this.#wanted = { ...this.#view(camera, { mode, before, only, gain }), moving };
    if (this.#asked === null) this.#next();
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
    this.#asked = ++this.#count;
    this.#connection.send({ type: "view", id: this.#asked, ...this.#latest });
  }

  async #receive(data) {
    const length = new DataView(data).getUint32(0, true);
    const header = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
    const { camera: { width, height }, mode } = this.#latest;
    this.#next();
    try {
      const picture = await createImageBitmap(new Blob([new Uint8Array(data, 4 + length)]));
      if (header.id > this.#shown) this.#show(picture, width, height, header, mode === "wipe");
      else picture.close();
    } catch (error) {
      this.#notice(`A frame could not be shown: ${error.message}`, "error");
    }
  }

  /** Show nothing: the frame before is none of what is asked for. */
  #refuse(why) {
    this.#canvas.classList.add("refused");
    this.onrefused(why);
  }

  #show(picture, width, height, header, isPair) {
    const canvas = this.#canvas;
    canvas.classList.remove("refused");
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    this.#picture?.close();
    this.#picture = picture;
    this.#isPair = isPair;
    this.#paint();
    this.#shown = header.id;
    this.onframe({ ...header, width: picture.width / (isPair ? 2 : 1), height: picture.height });
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
