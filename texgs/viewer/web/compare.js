// The scene beside its volume: the line between them, the scale of differences, and how close they are.

const STEP = 0.02; // of the width, a key
const get = (id) => document.getElementById(id);

export class Compare {
  #page;

  /** @param {object} page - with canvas, renderer, shown, onScreen and show() */
  constructor(page) {
    this.#page = page;
    get("gain").addEventListener("input", ({ target }) => page.show({ gain: 2 ** target.value }));
    const line = get("wipe");
    line.addEventListener("pointerdown", (event) => line.setPointerCapture(event.pointerId));
    line.addEventListener("pointermove", (event) => {
      const { left, width } = page.canvas.getBoundingClientRect();
      if (line.hasPointerCapture(event.pointerId)) this.#move((event.clientX - left) / width);
    });
    line.addEventListener("keydown", (event) => {
      const step = { ArrowLeft: -STEP, ArrowDown: -STEP, ArrowRight: STEP, ArrowUp: STEP, Home: -1, End: 1 }[event.key];
      if (!step) return;
      event.preventDefault();
      this.#move(page.shown.wipe + step);
    });
    this.show();
  }

  /** Show what belongs to the mode, and to that on the screen. */
  show() {
    const { shown: { mode, gain, wipe }, onScreen } = this.#page, percent = `${Number((100 / gain).toPrecision(3))} %`;
    get("wipe").hidden = onScreen !== "wipe";
    get("wipe").style.left = `${100 * wipe}%`;
    get("wipe").setAttribute("aria-valuenow", Math.round(100 * wipe));
    get("gain-row").hidden = mode !== "difference";
    get("gain-scale").hidden = onScreen !== "difference";
    get("gain").value = Math.log2(gain);
    get("gain-value").textContent = `× ${gain}`;
    get("gain-scale").firstChild.textContent = `−${percent}`;
    get("gain-scale").lastChild.textContent = `+${percent}`;
  }

  /** Tell how close scene and volume are in the picture, where that was measured. */
  tell(scores) {
    const closeness = (of) => `${scores[`${of}psnr`].toFixed(2)} dB, SSIM ${scores[`${of}ssim`].toFixed(4)}`;
    const rest = "object_psnr" in scores ? `on the object ${closeness("object_")}` : "no object in view";
    const whole = "psnr" in scores ? closeness("") : "";
    get("scores").textContent = whole && `PSNR of this view ${rest}; of the whole picture ${whole}.`;
  }

  #move(part) {
    this.#page.shown.wipe = Math.min(1, Math.max(0, part));
    this.#page.renderer.wipe(this.#page.shown.wipe);
    this.show();
  }
}
