// Markers and distances over the picture: points with a rim, a line between two, and words beside the right one.

import { lengthOf } from "./space.js";
import { addShape, path } from "./svg.js";

const RADIUS = 4.5, GAP = 12; // CSS pixels
const FARTHEST = 1e6; // pixels from the picture, which can still be drawn to

/** Where a marker's points are in a picture of this size; null where it is not seen. */
export function seenPoints({ points }, camera, width, height) {
  const seen = points.map((point) => camera.project(point, width, height));
  const isInside = ({ x, y }) => x >= 0 && y >= 0 && x < width && y < height;
  const canBe = ({ x, y, scale }) => scale > 0 && Math.max(Math.abs(x), Math.abs(y)) < FARTHEST;
  return seen.every(canBe) && seen.some(isInside) ? seen : null;
}

/** The words of a marker. */
export const wordsOf = (marker, space) => [marker.text, lengthOf(marker, space)].filter(Boolean).join(" ");

/** Where words of a length begin, beside the right point, or end, where there is no room, beside the left one. */
export function placeOfWords(seen, length, gap, width) {
  const [left, right] = [seen[0], seen.at(-1)].sort((one, other) => one.x - other.x);
  const fits = right.x + gap + length < width || right.x + left.x < width;
  return fits ? { x: right.x + gap, y: right.y, anchor: "start" } : { x: left.x - gap, y: left.y, anchor: "end" };
}

export class MarkerShapes {
  #page; #root;
  #drawn = []; // a group and its shapes for each marker

  /** @param {ScenePage} page - with `measure`, whose first point waits for the second one */
  constructor(page) {
    this.#page = page;
    this.#root = addShape(document.getElementById("marks"), "g", { class: "markers" });
  }

  /** Draw them as the camera sees them. */
  draw() {
    const { measure, shown, state } = this.#page, { markers, space } = shown.before ? state.original : state.scene;
    const all = shown.only ? [] : [...markers, ...(measure.begun ? [{ points: [measure.begun], text: "" }] : [])];
    while (this.#drawn.length < all.length) this.#drawn.push(this.#make());
    this.#drawn.forEach(({ group, place }, i) => {
      group.removeAttribute("hidden"); // what is hidden has no length of words
      group.toggleAttribute("hidden", !(all[i] && place(all[i], space)));
    });
  }

  #make() {
    const group = addShape(this.#root, "g", { class: "marker" });
    const lines = ["under", "line"].map((name) => addShape(group, "path", { class: name }));
    const dots = [0, 1].map(() => addShape(group, "circle", { r: RADIUS })), words = addShape(group, "text");
    const place = (marker, space) => {
      const { camera, canvas: { clientWidth, clientHeight } } = this.#page;
      const seen = seenPoints(marker, camera, clientWidth, clientHeight);
      if (!seen) return false;
      const line = seen.length > 1 ? path(seen.map(({ x, y }) => [x, y])) : "";
      for (const each of lines) each.setAttribute("d", line);
      [seen[0], seen.at(-1)].forEach(({ x, y }, i) => {
        dots[i].setAttribute("cx", x.toFixed(1));
        dots[i].setAttribute("cy", y.toFixed(1));
      });
      words.textContent = wordsOf(marker, space);
      const length = words.textContent && words.getComputedTextLength();
      const { x, y, anchor } = placeOfWords(seen, length, GAP, clientWidth);
      for (const [name, value] of Object.entries({ x, y, "text-anchor": anchor })) words.setAttribute(name, value);
      return true;
    };
    return { group, place };
  }
}
