// A picture without its background, from the same one over black and over white.

/** Straight alpha of two pictures [H, W, 4], 8 bits: what is less in one over black than over white is not covered. */
export function withAlpha(black, white) {
  const made = new Uint8ClampedArray(black.length);
  for (let i = 0; i < made.length; i += 4) {
    const uncovered = Math.max(...[0, 1, 2].map((k) => white[i + k] - black[i + k])), alpha = 255 - uncovered;
    for (let k = 0; k < 3; k++) made[i + k] = alpha ? 255 * black[i + k] / alpha : 0;
    made[i + 3] = alpha;
  }
  return made;
}
