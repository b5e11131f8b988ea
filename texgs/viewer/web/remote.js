// The renderer on the server: asks for frames and shows them. The next one is asked for when the last is there.

import { sizeOf } from "./size.js";

export class Remote {
  #canvas; #context; #notice; #connection;
  #asked = null; // id of the frame that is on its way
  #wanted = null; // the newest view that was not asked for yet
  #latest = null; // the view that was asked for last, to ask again after a break
  #count = 0;
  #shown = 0; // id of the frame on the canvas

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
  }

  /** Show what comes by a connection. */
  async open(connection, scene) {
    this.#connection = connection;
    this.modes = scene.modes;
    connection.addEventListener("frame", ({ detail }) => this.#receive(detail));
    connection.addEventListener("message", ({ detail }) => {
      // it could not be rendered, or asked for; a notice says why
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
  draw(camera, scene, { moving, mode = "shaded", before = false, only = "" }) {
    this.#wanted = { camera: camera.wire(...this.size()), mode, moving, before, only };
    if (this.#asked === null) this.#next();
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
    const { width, height } = this.#latest.camera;
    this.#next();
    try {
      const picture = await createImageBitmap(new Blob([new Uint8Array(data, 4 + length)]));
      if (header.id > this.#shown) this.#show(picture, width, height, header);
      picture.close();
    } catch (error) {
      this.#notice(`A frame could not be shown: ${error.message}`, "error");
    }
  }

  #show(picture, width, height, header) {
    const canvas = this.#canvas;
    if (canvas.width !== width) canvas.width = width;
    if (canvas.height !== height) canvas.height = height;
    this.#context.drawImage(picture, 0, 0, width, height);
    this.#shown = header.id;
    this.onframe({ ...header, width: picture.width, height: picture.height });
  }
}
