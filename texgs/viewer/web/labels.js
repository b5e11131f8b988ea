// Labels of a volume: which functions show one, and what slices show of them, as texgs/volume/slices.py has it.

import { HALF, halfOf, placeOf, shownOf } from "./function_table.js";

const INSIDE = 255; // value of a mask
const COVER = 0.6; // of a label over an image

/**
 * The labels that a page has, in the colours that they have now.
 *
 * @param {object} scene description with its edits.
 * @param {object[]} channels of the page, see texgs/viewer/page_volume.py.
 * @returns {{name: string, channel: number, half: number, color: ?number[], cover: number}[]} the place of the mask
 *   among the channels, the share of its codes from which on it counts; without a colour it is hidden.
 */
export function labelsOf(scene, channels) {
  const shown = shownOf({ ...scene, functions: {} }), isLabel = ({ opacity }) =>
    opacity[0][0] === HALF && opacity[0][1] > 0 && opacity.at(-1)[0] === INSIDE;
  const labels = Object.entries(scene.tfs).filter(([, tf]) => isLabel(tf)).map(([name, tf]) => {
    const channel = placeOf(tf.channel, channels), own = shown.find((each) => each.name === name);
    return { name, channel, half: halfOf(channels[channel]), color: own ? own.colorAt(INSIDE) : null };
  });
  const cover = labels.some(({ channel }) => channel === 0) ? 1 : COVER; // then there is no image
  return labels.map((each) => ({ ...each, cover }));
}
