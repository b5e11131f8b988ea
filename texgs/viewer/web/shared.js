// A scene that several pages edit: the server holds it, and what is edited here shows here at once.

import { State, edited, titleOf } from "./state.js";

export class SharedState extends State {
  #connection;
  #sent = 0; // messages, of which the server answers each with the scene
  #answered = 0;

  /**
   * @param {object} greeting - of the server: the scene as it is now and as it was opened, and its history
   * @param {Connection} connection
   */
  constructor({ scene, original, past, future, saved, file, folder, title }, connection) {
    super(scene);
    Object.assign(this, { original, past, future, saved, file, folder, title });
    this.#connection = connection;
  }

  /** Begin to count anew: the server does so with each connection. */
  restart() {
    this.#sent = this.#answered = 0;
  }

  /** Take the server's scene, unless it does not know yet what was edited here since. */
  adopt({ scene, answered, past, future, saved, file, folder, title }) {
    this.#answered = answered;
    if (answered !== this.#sent) return;
    this.update({ scene: { ...this.scene, ...scene }, past, future, saved, file, folder, title });
  }

  /** Whether the server has not made yet what was edited here. */
  get isPending() {
    return this.#answered !== this.#sent;
  }

  edit(part, key, value, step = 0) {
    if (this.#send({ type: "edit", part, key, value, step, title: titleOf({ part, key, value }, this.scene) })) {
      this.update({ scene: edited(this.scene, { part, key, value }) });
    } else {
      this.update({}); // without a connection nothing changes: inputs show what there is
    }
  }

  undo() {
    this.#send({ type: "undo" });
  }

  redo() {
    this.#send({ type: "redo" });
  }

  /** Give a segment another name. */
  rename(part, name) {
    this.#send({ type: "rename", part, name });
  }

  /** Give the surfels of a segment back to its model. */
  remove(part) {
    this.#send({ type: "remove", part });
  }

  /** Write the scene file; asks before another file is replaced. */
  save(name, replace = false) {
    this.#send({ type: "save", name, replace });
  }

  #send(message) {
    if (message.type !== "save") this.dispatchEvent(new Event("edit"));
    const sent = this.#connection.send(message);
    if (sent) this.#sent += 1;
    return sent;
  }
}
