// The legend of what is shown: names, colours and ranges of values, in a corner of the picture.

import { element, tick, toHex } from "./inputs.js";

const clamp = (x) => Math.min(1, Math.max(0, x));

/** Lines of the visible parts of a scene; its description has those of models as they were fitted. */
export function linesOf({ legend, models }) {
  return models.flatMap(({ name, edit, fitted_palette: fitted, segments }) => {
    const line = legend.find((each) => each.name === name);
    const own = segments.filter((each) => each.edit.palette && String(each.edit.palette) !== String(edit.palette));
    const parts = [{ name, edit }, ...own.map((each) => ({ ...each, name: `${name}/${each.name}` }))];
    return parts.filter((each) => each.edit.visible && each.edit.opacity > 0).flatMap((part) => {
      const { palette } = part.edit;
      if (!line) return palette ? [{ name: part.name, colors: [palette], range: "" }] : [];
      const moved = (color) => color.map((x, i) => clamp(x + palette[i] - fitted[i]));
      const edited = palette && (line.colors.length > 1 ? line.colors.map(moved) : [palette]);
      return [{ ...line, name: part.name, colors: edited || line.colors }];
    });
  });
}

export class Legend {
  #page; #root = element("ul", { id: "legend", "aria-label": "Names and colours", hidden: true });
  #latest = "";

  /** @param {ScenePage} page */
  constructor(page) {
    this.#page = page;
    document.querySelector("main").append(this.#root);
    document.getElementById("mark-inputs").append(tick("Legend", (legend) => page.show({ legend })).row);
  }

  /** Show it as the scene is. */
  draw() {
    const { shown, state } = this.#page, lines = linesOf(shown.before ? state.original : state.scene);
    this.#root.hidden = !shown.legend || !lines.length;
    const latest = JSON.stringify(lines);
    if (this.#root.hidden || latest === this.#latest) return;
    this.#latest = latest;
    this.#root.replaceChildren(...lines.map(({ name, colors, range }) => {
      const swatch = element("span", { className: "swatch" }), stops = colors.map(toHex);
      swatch.style.background = `linear-gradient(90deg, ${[stops[0], ...stops].join()})`;
      return element("li", {}, swatch, `${name}  ${range}`.trim());
    }));
  }
}
