// Parts of drawings that lie over the picture.

const SPACE = "http://www.w3.org/2000/svg";

/** Adds an element with attributes. */
export function addShape(parent, tag, values = {}) {
  const made = parent.appendChild(document.createElementNS(SPACE, tag));
  for (const [name, value] of Object.entries(values)) made.setAttribute(name, value);
  return made;
}

/** The words of a path through points. */
export const path = (points) => `M${points.map(([x, y]) => `${x.toFixed(1)},${y.toFixed(1)}`).join("L")}`;
