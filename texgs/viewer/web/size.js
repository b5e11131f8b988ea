// How large pictures are.

export const MOST_PIXELS = 4096; // of a side, as the server has it

/** Width and height of a canvas in pixels of the screen. */
export function sizeOf({ clientWidth, clientHeight }) {
  const scale = Math.min(window.devicePixelRatio, MOST_PIXELS / Math.max(clientWidth, clientHeight, 1));
  return [clientWidth, clientHeight].map((side) => Math.max(1, Math.round(scale * side)));
}
