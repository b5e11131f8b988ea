// The connection to the server: messages both ways, made anew by itself when it breaks.

const FIRST_DELAY = 500, LONGEST_DELAY = 4000; // milliseconds before another attempt
const SILENCE = 20_000; // milliseconds without a word, of which the server has one every 5 s: it counts as broken
const ENDED = 1001; // the server's code where it has ended: the next one has another address

/** Dispatches "message" (detail: parsed JSON), "frame" (detail: ArrayBuffer), "open", "lost" (detail: why) and "unsent". */
export class Connection extends EventTarget {
  #socket = null;
  #delay = FIRST_DELAY;
  #timer = 0; // until it counts as broken

  constructor(address) {
    super();
    this.address = address;
    this.#open();
  }

  get isOpen() {
    return this.#socket?.readyState === WebSocket.OPEN;
  }

  /** Send a message; whether there was a connection to send it by. */
  send(message) {
    if (this.isOpen) this.#socket.send(JSON.stringify(message));
    else this.dispatchEvent(new Event("unsent"));
    return this.isOpen;
  }

  #open() {
    const socket = this.#socket = new WebSocket(this.address);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => this.dispatchEvent(new Event("open"));
    socket.onmessage = ({ data }) => {
      this.#delay = FIRST_DELAY; // not before: a server may end at once what it has taken
      this.#wait();
      const [name, detail] = typeof data === "string" ? ["message", JSON.parse(data)] : ["frame", data];
      this.dispatchEvent(new CustomEvent(name, { detail }));
    };
    socket.onclose = ({ code, reason }) => this.#lose(reason, code !== ENDED);
    this.#wait();
  }

  #wait() {
    clearTimeout(this.#timer);
    this.#timer = setTimeout(() => this.#lose(""), SILENCE);
  }

  #lose(why, isTriedAgain = true) {
    const socket = this.#socket;
    clearTimeout(this.#timer);
    socket.onopen = socket.onmessage = socket.onclose = null; // a half-open one would end only after a while
    socket.close();
    this.dispatchEvent(new CustomEvent("lost", { detail: why }));
    if (!isTriedAgain) return;
    setTimeout(() => this.#open(), this.#delay);
    this.#delay = Math.min(2 * this.#delay, LONGEST_DELAY);
  }
}
