// Which steps of a series in time a page holds that is exported.

import { element } from "./inputs.js";
import { numberInput } from "./size_inputs.js";

const KINDS = ["html", "volume"];
const get = (id) => document.getElementById(id);

export class PageInputs {
  #isSeries;
  #which = element("select", {},
    new Option("All", "all"), new Option("Each N-th", "each"), new Option("The one that is shown", "one"));
  #each = numberInput("N", { min: 2, max: 99999, step: 1, value: 5 });

  /** @param {{steps: string[]}} scene */
  constructor({ steps }) {
    this.#isSeries = steps.length > 1;
    get("page-steps").append(element("label", { className: "row" }, "Steps in time", this.#which), this.#each.row);
    for (const input of [get("export-kind"), this.#which]) input.addEventListener("change", () => this.show());
  }

  /** What is no page of a series has no inputs that a form could require. */
  show() {
    const root = get("page-steps"), isEach = this.#which.value === "each";
    root.hidden = root.disabled = !this.#isSeries || !KINDS.includes(get("export-kind").value);
    this.#each.row.hidden = this.#each.input.disabled = !isEach;
  }

  get values() {
    if (get("page-steps").disabled) return {};
    return { steps: this.#which.value === "each" ? this.#each.input.value : this.#which.value };
  }
}
