// A new segment: clicks on a model alone or an outline, the mask that they select, and the wait until it is found.

const get = (id) => document.getElementById(id);
const STILL = 4; // CSS pixels that a click may move
const MOST_POINTS = 100, MOST_CORNERS = 500; // as the server has it
const HINTS = { // before anything is chosen
  points: "Turn the model as you like, and click on what belongs to the segment.",
  box: "Drag a box around what belongs to the segment.",
  lasso: "Draw around what belongs to the segment.",
};
const COLORS = { true: "#0a8f2f", false: "#1540d0" }; // of points on the object, and beside it

export class SegmentTool {
  #page; #model = null; #points = []; #confirmed = 0; #asked = 0; #picture = null; #down = null;
  #outline = null; #good = null; // corners around the object, and those that a mask has been found for
  #stroke = null; // corners, while they are drawn

  /** @param {object} page - with camera, canvas, connection, notices, renderer, state, and show() */
  constructor(page) {
    this.#page = page;
    const { canvas, connection, job } = page;
    canvas.addEventListener("pointerdown", (event) => this.#begin(event));
    canvas.addEventListener("pointermove", (event) => this.#extend(event));
    canvas.addEventListener("pointerup", () => this.#close());
    canvas.addEventListener("pointercancel", () => this.#begin());
    canvas.addEventListener("click", (event) => this.#click(event));
    canvas.addEventListener("keydown", (event) => {
      if (!this.#model) return;
      if (event.key === "Enter") this.#add(canvas.clientWidth / 2, canvas.clientHeight / 2, event.shiftKey);
      if (event.key === "Escape") this.leave();
    });
    new ResizeObserver(() => this.#clear()).observe(canvas);
    const { state } = page;
    let { time } = state.scene;
    state.addEventListener("change", () => { // clicks belong to one step in time, too
      if (this.#model && state.scene.time !== time) this.#clear();
      time = state.scene.time;
    });
    get("segment").addEventListener("submit", (event) => {
      event.preventDefault();
      this.#make();
    });
    get("segment").addEventListener("change", () => this.#show());
    get("segment-clear").onclick = () => this.#clear();
    get("segment-cancel").onclick = () => this.leave();
    connection.addEventListener("message", ({ detail }) => this.#receive(detail));
    connection.addEventListener("lost", () => this.#end());
    job.addEventListener("begin", () => this.#show());
    job.addEventListener("end", ({ detail }) =>
      detail.kind !== "segment" || detail.hasFailed ? this.#show() : this.#end());
  }

  /** Whether the camera has to stay: points and outlines belong to one view. */
  get isLocked() {
    return this.#points.length > 0 || Boolean(this.#outline ?? this.#stroke);
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

  /** Begin to draw, with the only button or finger: a second finger moves the camera instead. */
  #begin(event) {
    this.#down = event;
    const isDrawn = this.#model && this.#shape !== "points" && !this.#page.job.isAtWork;
    this.#stroke = isDrawn && event?.isPrimary && event.button === 0 ? [[event.offsetX, event.offsetY]] : null;
    this.#draw();
  }

  #extend({ isPrimary, offsetX, offsetY }) {
    if (!this.#stroke || !isPrimary) return;
    const { clientWidth, clientHeight } = this.#page.canvas, [[left, top]] = this.#stroke;
    const x = Math.min(Math.max(offsetX, 0), clientWidth), y = Math.min(Math.max(offsetY, 0), clientHeight);
    const [lastX, lastY] = this.#stroke.at(this.#shape === "box" ? 0 : -1);
    if (Math.hypot(x - lastX, y - lastY) <= STILL) return;
    if (this.#shape === "box") this.#stroke = [[left, top], [x, top], [x, y], [left, y]];
    else this.#stroke.push([x, y]);
    this.#draw();
  }

  #close() {
    const stroke = this.#stroke ?? [], step = Math.ceil(stroke.length / MOST_CORNERS);
    this.#stroke = null;
    this.#draw();
    if (stroke.length < 3) return;
    this.#down = null; // what ends is no click
    this.#outline = stroke.filter((_, index) => index % step === 0);
    this.#ask();
  }

  get #shape() {
    return get("segment").elements.shape.value;
  }

  #click(event) {
    const { clientX, clientY, shiftKey, offsetX, offsetY } = event;
    const moved = Math.hypot(clientX - this.#down?.clientX, clientY - this.#down?.clientY); // NaN: was drawn
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
    this.#outline = this.#good = this.#stroke = null;
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

  /** The clicks and the outline, in pixels of the picture. */
  #clicked() {
    const { camera, canvas, renderer } = this.#page, [width, height] = renderer.size();
    const scaled = ([x, y, ...more]) => [x * width / canvas.clientWidth, y * height / canvas.clientHeight, ...more];
    const [points, outline] = [this.#points, this.#outline].map((places) => places?.map(scaled));
    return { camera: camera.wire(width, height), points, outline };
  }

  #receive(message) {
    if (message.type === "mask" && message.id === this.#asked) {
      this.#confirmed = this.#points.length;
      this.#good = this.#outline;
      const picture = new Image();
      picture.onload = () => {
        if (message.id !== this.#asked) return;
        this.#picture = picture;
        this.#show();
      };
      picture.src = message.picture;
      get("segment-by").textContent = `Mask by ${message.by}.`;
    } else if (message.mask === this.#asked && this.#outline !== this.#good) {
      this.#outline = this.#good;
      this.#ask();
    } else if (message.mask === this.#asked && this.#confirmed < this.#points.length) {
      this.#points.splice(this.#confirmed, 1); // the notice says what is wrong; the first new one may be it
      this.#ask();
    }
  }

  #show() {
    get("segment-hint").textContent = this.isLocked
      ? `Clicks${this.#outline ? " inside" : ""} add to it, with Shift they take away. The camera stays until you clear.`
      : HINTS[this.#shape];
    get("segment-make").disabled = get("segment-clear").disabled = !this.isLocked || this.#page.job.isAtWork;
    this.#draw();
  }

  #draw() {
    const { clientWidth, clientHeight } = this.#page.canvas, ratio = window.devicePixelRatio;
    const overlay = get("overlay"), context = overlay.getContext("2d");
    overlay.width = Math.round(clientWidth * ratio);
    overlay.height = Math.round(clientHeight * ratio);
    if (this.#picture) context.drawImage(this.#picture, 0, 0, overlay.width, overlay.height);
    this.#drawOutline(context, ratio);
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

  #drawOutline(context, ratio) {
    context.beginPath();
    for (const [x, y] of this.#stroke ?? this.#outline ?? []) context.lineTo(x * ratio, y * ratio);
    context.closePath();
    for (const [width, color] of [[4, "white"], [2, COLORS.true]]) {
      context.lineWidth = width * ratio;
      context.strokeStyle = color;
      context.stroke();
    }
  }
}
