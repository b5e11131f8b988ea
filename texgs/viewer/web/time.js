// The step of a series in time that is shown: a slider, and a button that plays the steps.

import { element, gesture, newGesture } from "./inputs.js";
import { timesOf } from "./state.js";

const PACE = 200; // milliseconds from step to step, at least

export class TimeSlider {
  #state; #times; #range; #name; #play; #isBusy; #timer = 0; #played = 0; #isOwn = false;

  /**
   * @param {State} state
   * @param {Element} root - for the inputs; hidden where there are no other steps
   * @param {() => boolean} isBusy - whether a step that was asked for is not shown yet
   */
  constructor(state, root, isBusy) {
    const { steps } = state.scene, times = this.#times = timesOf(state.scene);
    this.#state = state;
    this.#isBusy = isBusy;
    root.hidden = times.length < 2;
    this.#range = element("input", { type: "range", "aria-label": "Step in time" });
    Object.assign(this.#range, { min: 0, max: Math.max(times.length - 1, 0), step: 1 });
    this.#name = element("output");
    this.#play = element("button", { type: "button", onclick: () => this.#timer ? this.stop() : this.play() }, "Play");
    const use = gesture(this.#range, (step) => this.#show(this.#range.value, step));
    this.#range.addEventListener("pointerdown", () => this.stop());
    root.append(element("span", { className: "name" }, "Time"), this.#range, this.#name, this.#play);
    const show = () => {
      const { time } = state.scene;
      if (this.#timer && state.future.length) this.stop(); // somebody took a step back
      if (!use.isBusy()) this.#range.value = times.indexOf(time);
      this.#name.textContent = time ?? "";
      this.#name.title = this.#range.ariaValueText = steps[time] ?? "";
    };
    state.addEventListener("change", show);
    state.addEventListener("edit", () => { // else its steps would part those of a drag
      if (!this.#isOwn) this.stop();
    });
    show();
  }

  /** Show one step after the other, as fast as they are drawn; all of it is one step of the history. */
  play() {
    this.#played = newGesture();
    this.#play.textContent = "Pause";
    this.#timer = setInterval(() => {
      const next = this.#times.indexOf(this.#state.scene.time) + 1;
      if (!this.#isBusy()) this.#show(next % this.#times.length, this.#played);
    }, PACE);
  }

  /** Milliseconds in which another step may follow: there is no rest meanwhile. */
  get pause() {
    return this.#timer ? 2 * PACE : 0;
  }

  stop() {
    clearInterval(this.#timer);
    this.#timer = 0;
    this.#play.textContent = "Play";
  }

  #show(index, step) {
    this.#isOwn = true;
    this.#state.edit("", "time", this.#times[index], step);
    this.#isOwn = false;
  }
}
