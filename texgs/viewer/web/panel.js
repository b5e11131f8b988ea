// The inputs of all models and segments, and of the scene's background; and the list of steps.

import { isUnedited } from "./state.js";
import { capital, colorInput, element, slider, tick } from "./inputs.js";

const FACTORS = { ambient: 3, diffuse: 3, specular: 4, shininess: 16 }; // and where their sliders end
const OPAQUE = 2;

const button = (text, what, onclick) =>
  element("button", { type: "button", "aria-label": what, onclick }, text);

export class Panel {
  #state; #root; #steps; #background; #actions;
  #structure = ""; // names of all parts that there are inputs for
  #parts = new Map(); // by part: a function that shows its edit

  /**
   * @param {State} state
   * @param {{models: Element, background: Element, steps: Element}} places - for its inputs
   * @param {{segment?: (model: object) => void, look?: (part: string) => void, rename?: (part: string) => void,
   *   remove?: (part: string) => void}} actions - what else can be done to a part, where a server does it
   */
  constructor(state, { models, background, steps }, actions = {}) {
    this.#state = state;
    this.#actions = actions;
    this.#root = models;
    this.#steps = steps;
    this.#background = colorInput("Background", "background", (color, step) =>
      state.edit("", "background", color, step));
    background.append(this.#background.row);
    state.addEventListener("change", () => this.show());
    this.show();
  }

  /** Show the state as it is. */
  show() {
    const { scene } = this.#state;
    const structure = JSON.stringify(scene.models.map((m) => [m.name, m.can, m.segments.map((s) => s.name)]));
    if (structure !== this.#structure) this.#build(structure);
    for (const model of scene.models) {
      this.#parts.get(model.name)(model.edit, model, model.styled);
      for (const each of model.segments) this.#parts.get(`${model.name}/${each.name}`)(each.edit, model, each.styled);
    }
    this.#background.show(scene.background, scene.background.some((x) => x !== 1));
    this.#showSteps();
  }

  #build(structure) {
    const focused = this.#root.contains(document.activeElement) ? document.activeElement : null;
    const used = focused?.ariaLabel, model = focused?.closest("fieldset").dataset.model;
    const opened = new Set([...this.#root.querySelectorAll("details[open]")].map((each) => each.dataset.part));
    this.#structure = structure;
    this.#parts.clear();
    this.#root.replaceChildren(...this.#state.scene.models.map((model) => {
      const { segment } = this.#actions, box = this.#part(model.name, model.name, model.can);
      box.append(...model.segments.map((each) => this.#segment(model, each.name)), ...this.#look(model, model.name));
      if (segment && model.can.includes("segments")) {
        const current = () => this.#state.scene.models.find((each) => each.name === model.name);
        box.append(button("New segment…", `New segment of ${model.name}`, () => segment(current())));
      }
      return box;
    }));
    for (const each of this.#root.querySelectorAll("details")) each.open = opened.has(each.dataset.part);
    if (focused) this.#focus(used, model);
  }

  /** Focus the input of this label, or the first one of the model if it is gone. */
  #focus(label, model) {
    const inputs = [...this.#root.querySelectorAll("input, button, summary")];
    const isOfModel = (each) => each.closest("fieldset").dataset.model === model;
    (inputs.find((each) => each.ariaLabel && each.ariaLabel === label) ?? inputs.find(isOfModel))?.focus();
  }

  #segment(model, name) {
    const part = `${model.name}/${name}`, box = this.#part(part, name, model.can);
    const { rename, remove } = this.#actions;
    box.append(...this.#look(model, part));
    if (rename) box.append(button("Rename…", `Rename ${part}`, () => rename(part)));
    if (remove) box.append(button("Remove", `Remove ${part}`, () => remove(part)));
    return box;
  }

  /** A button for a new look of a part, where it can have one. */
  #look(model, part) {
    const { look } = this.#actions;
    if (!look || !model.can.includes("look")) return [];
    return [button("New look…", `New look of ${part}`, () => look(part))];
  }

  /** The inputs of a model or a segment. */
  #part(part, name, can) {
    const edit = (key) => (value, step) => this.#state.edit(part, key, value, step);
    const legend = element("legend"), box = element("fieldset", { className: "part" }, legend);
    [box.dataset.model] = part.split("/");
    const shows = [];
    const add = (parent, key, input, value = (each) => each[key]) => {
      parent.append(input.row);
      shows.push((each, model) => input.show(value(each, model), !isUnedited(key, each[key])));
    };
    const factor = (key, max) => slider(capital(key), `${key} of ${part}`, { max }, edit(key));
    if (can.includes("visible")) add(legend, "visible", tick(name, edit("visible"), { title: "Visible" }));
    else legend.append(name);
    if (can.includes("palette")) {
      const color = colorInput("Palette", `palette of ${part}`, edit("palette"));
      const under = element("p", { className: "hint" }, "A look covers its palette, which still shifts the colours.");
      add(box, "palette", color, (each, model) => each.palette ?? model.fitted_palette);
      box.append(under);
      shows.push((each, model, styled) => { under.hidden = !styled; });
    }
    if (can.includes("opacity")) add(box, "opacity", factor("opacity", OPAQUE));
    const factors = Object.entries(FACTORS).filter(([key]) => can.includes(key));
    if (factors.length) {
      const material = element("details", {}, element("summary", {}, "Material"));
      material.dataset.part = part;
      for (const [key, max] of factors) add(material, key, factor(key, max));
      add(material, "tint", colorInput("Tint", `tint of highlights of ${part}`, edit("tint")));
      box.append(material);
    }
    this.#parts.set(part, (each, model, styled) => {
      box.classList.toggle("hidden-part", !each.visible);
      for (const show of shows) show(each, model, styled);
    });
    return box;
  }

  #showSteps() {
    const { past, future } = this.#state;
    const made = past.map((name) => element("li", {}, name));
    made.at(-1)?.setAttribute("aria-current", "step");
    const undone = future.map((name) => element("li", { className: "undone" }, name));
    this.#steps.replaceChildren(...made, ...undone);
    this.#steps.scrollTop = this.#steps.scrollHeight * past.length / (past.length + future.length) // the current one
      - this.#steps.clientHeight;
  }
}
