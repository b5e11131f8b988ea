// What the server makes for this page and takes a while: how far it is, and a button to stop it.

const LEAST = 2; // seconds until the time that is left can be told
const get = (id) => document.getElementById(id);

/** Dispatches "begin" and "end"; detail.kind is the type of the message that asked for it, and detail.hasFailed
 * says whether nothing came of it. */
export class Job extends EventTarget {
  isAtWork = false;
  kind = "";
  #connection;
  #begun = { title: "", at: 0 }; // of the loop that is at work; milliseconds

  constructor(connection) {
    super();
    this.#connection = connection;
    get("job-cancel").onclick = () => this.cancel();
    connection.addEventListener("message", ({ detail }) => {
      if (detail.type === "job") this.#show(detail);
    });
    connection.addEventListener("lost", () => this.#show({ done: null, failed: true }));
  }

  /** Ask for something; whether there was a connection to ask by. */
  begin(message) {
    const isAsked = !this.isAtWork && this.#connection.send(message);
    if (isAsked) this.kind = message.type;
    return isAsked;
  }

  /** Stop what is being made, and take a preview off. */
  cancel() {
    this.#connection.send({ type: "cancel" });
  }

  /** The same, unless what is being made is of another kind: that goes on. */
  leave(kind) {
    const isOther = this.isAtWork && this.kind !== kind;
    this.#connection.send({ type: "cancel", preview: isOther });
  }

  /** How long a loop takes from now on, at the pace that it has had; nothing before that is known. */
  #left(title, done) {
    const now = performance.now();
    if (title !== this.#begun.title || !done) this.#begun = { title, at: now };
    const gone = (now - this.#begun.at) / 1000, left = gone * (1 - done) / done;
    if (gone < LEAST) return "";
    return left < 100 ? `${Math.ceil(left)} s left` : `${Math.ceil(left / 60)} min left`;
  }

  #show({ title, done, failed = false }) {
    const wasAtWork = this.isAtWork;
    this.isAtWork = done !== null;
    get("job").hidden = !this.isAtWork;
    if (this.isAtWork) {
      get("job-progress").value = done;
      get("job-title").textContent = title;
      get("job-left").textContent = this.#left(title, done);
    }
    if (wasAtWork === this.isAtWork) return;
    const detail = { kind: this.kind, hasFailed: failed };
    this.dispatchEvent(new CustomEvent(this.isAtWork ? "begin" : "end", { detail }));
  }
}
