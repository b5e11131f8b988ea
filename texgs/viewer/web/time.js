// The step of a series in time that is shown: a slider, and a button that plays the steps.

import { element, gesture, newGesture } from "./inputs.js";

const PACE = 200; // milliseconds from step to step, at least

export class TimeSlider {
  #state; #range; #name; #play; #timer = 0; #played = 0;

  /**
   * @param {SharedState} state
   * @param {Element} root - for the inputs; hidden where the scene has no series
   */
  constructor(state, root) {
    const { steps } = state.scene;
    this.#state = state;
    root.hidden = steps.length < 2;
    this.#range = element("input", { type: "range", "aria-label": "Step in time" });
    Object.assign(this.#range, { min: 0, max: Math.max(steps.length - 1, 0), step: 1 });
    this.#name = element("output");
    this.#play = element("button", { type: "button", onclick: () => this.#timer ? this.stop() : this.play() }, "Play");
    const use = gesture(this.#range, (step) => this.#show(Number(this.#range.value), step));
    this.#range.addEventListener("pointerdown", () => this.stop());
    root.append(element("span", { className: "name" }, "Time"), this.#range, this.#name, this.#play);
    const show = () => {
      const { time } = state.scene;
      if (!use.isBusy()) this.#range.value = time ?? 0;
      this.#name.textContent = time ?? "";
      this.#name.title = this.#range.ariaValueText = steps[time] ?? "";
    };
    state.addEventListener("change", show);
    show();
  }

  /** Show one step after the other, as fast as the server makes them; all of it is one step of the history. */
  play() {
    this.#played = newGesture();
    this.#play.textContent = "Pause";
    this.#timer = setInterval(() => {
      const { scene, isPending } = this.#state;
      if (!isPending) this.#show((scene.time + 1) % scene.steps.length, this.#played);
    }, PACE);
  }

  stop() {
    clearInterval(this.#timer);
    this.#timer = 0;
    this.#play.textContent = "Play";
  }

  #show(time, step) {
    this.#state.edit("", "time", time, step);
  }
}
