// A new segment: clicks on a model alone, the mask that they select, and the wait until it is found in space.

const get = (id) => document.getElementById(id);
const STILL = 4; // CSS pixels that a click may move
const MOST_POINTS = 100; // as the server has it
const COLORS = { true: "#0a8f2f", false: "#1540d0" }; // of points on the object, and beside it

export class SegmentTool {
  #page; #model = null; #points = []; #confirmed = 0; #asked = 0; #picture = null; #down = null;

  /** @param {object} page - with camera, canvas, connection, notices, renderer, state, and show() */
  constructor(page) {
    this.#page = page;
    const { canvas, connection, job } = page;
    canvas.addEventListener("pointerdown", (event) => { this.#down = event; });
    canvas.addEventListener("click", (event) => this.#click(event));
    canvas.addEventListener("keydown", (event) => {
      if (!this.#model) return;
      if (event.key === "Enter") this.#add(canvas.clientWidth / 2, canvas.clientHeight / 2, event.shiftKey);
      if (event.key === "Escape") this.leave();
    });
    new ResizeObserver(() => this.#clear()).observe(canvas);
    get("segment").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#make();
    });
    get("segment-clear").onclick = () => this.#clear();
    get("segment-cancel").onclick = () => this.leave();
    connection.addEventListener("message", ({ detail }) => this.#receive(detail));
    connection.addEventListener("lost", () => this.#end());
    job.addEventListener("begin", () => this.#show());
    job.addEventListener("end", ({ detail }) =>
      detail.kind !== "segment" || detail.hasFailed ? this.#show() : this.#end());
  }

  /** Whether the camera has to stay: points belong to one view. */
  get isLocked() {
    return this.#points.length > 0;
  }

  /** Begin with a model. */
  start({ name, segments }) {
    this.#model = name;
    const taken = segments.map((each) => each.name);
    let number = 1;
    while (taken.includes(`part${number}`)) number += 1;
    get("segment-name").value = `part${number}`;
    get("segment").hidden = false;
    this.#page.show({ only: name, mode: "shaded", before: false });
    this.#clear();
    this.#page.canvas.focus();
  }

  #click(event) {
    const { clientX, clientY, shiftKey, offsetX, offsetY } = event;
    const moved = Math.hypot(clientX - this.#down?.clientX, clientY - this.#down?.clientY);
    if (this.#model && !this.#page.job.isAtWork && moved <= STILL) this.#add(offsetX, offsetY, shiftKey);
  }

  #add(x, y, hasShift) {
    if (this.#page.job.isAtWork) return;
    const positive = !hasShift && !get("segment-negative").checked;
    if (!positive && !this.isLocked) {
      this.#page.notices.tell("Click on the object first.", "info");
      return;
    }
    if (this.#points.length === MOST_POINTS) {
      this.#page.notices.tell(`A segment has at most ${MOST_POINTS} points.`, "info");
      return;
    }
    this.#points.push([x, y, positive]);
    this.#ask();
  }

  /** Ask what the points select. */
  #ask() {
    this.#asked += 1;
    if (this.isLocked) {
      this.#page.connection.send({ type: "mask", id: this.#asked, model: this.#model, ...this.#clicked() });
    }
    this.#show();
  }

  #clear() {
    this.#points = [];
    this.#confirmed = 0; // of the points, from the first on, a mask has been found for
    get("segment-negative").checked = false;
    this.#picture = null;
    this.#asked += 1; // masks that are on their way are none of ours
    this.#show();
  }

  #make() {
    const part = `${this.#model}/${get("segment-name").value.trim()}`;
    if (this.isLocked) this.#page.job.begin({ type: "segment", part, ...this.#clicked() });
  }

  /** Stop. */
  leave() {
    const { job } = this.#page;
    if (job.isAtWork && job.kind === "segment") job.cancel();
    this.#end();
  }

  #end() {
    if (!this.#model) return;
    this.#model = null;
    if (get("segment").contains(document.activeElement)) this.#page.canvas.focus();
    get("segment").hidden = true;
    this.#clear();
    this.#page.show({ only: "" });
  }

  /** The clicks, in pixels of the picture. */
  #clicked() {
    const { camera, canvas, renderer } = this.#page, [width, height] = renderer.size();
    const points = this.#points.map(([x, y, positive]) =>
      [x * width / canvas.clientWidth, y * height / canvas.clientHeight, positive]);
    return { camera: camera.wire(width, height), points };
  }

  #receive(message) {
    if (message.type === "mask" && message.id === this.#asked) {
      this.#confirmed = this.#points.length;
      const picture = new Image();
      picture.onload = () => {
        if (message.id !== this.#asked) return;
        this.#picture = picture;
        this.#show();
      };
      picture.src = message.picture;
      get("segment-by").textContent = `Mask by ${message.by}.`;
    } else if (message.mask === this.#asked && this.#confirmed < this.#points.length) {
      this.#points.splice(this.#confirmed, 1); // the notice says what is wrong; the first new one may be it
      this.#ask();
    }
  }

  #show() {
    get("segment-hint").textContent = this.isLocked
      ? "Clicks add to it, with Shift they take away. The camera stays until you clear the points."
      : `Turn ${this.#model} as you like, and click on what belongs to the segment.`;
    get("segment-make").disabled = get("segment-clear").disabled = !this.isLocked || this.#page.job.isAtWork;
    this.#draw();
  }

  #draw() {
    const { clientWidth, clientHeight } = this.#page.canvas, ratio = window.devicePixelRatio;
    const overlay = get("overlay"), context = overlay.getContext("2d");
    overlay.width = Math.round(clientWidth * ratio);
    overlay.height = Math.round(clientHeight * ratio);
    if (this.#picture) context.drawImage(this.#picture, 0, 0, overlay.width, overlay.height);
    context.lineWidth = 2 * ratio;
    context.strokeStyle = "white";
    for (const [x, y, positive] of this.#points) {
      context.fillStyle = COLORS[positive];
      context.beginPath();
      context.arc(x * ratio, y * ratio, 6 * ratio, 0, 2 * Math.PI);
      context.fill();
      context.stroke();
    }
  }
}
