// Markers and the legend on a picture that the page saves: as texgs.scene.marks draws them.

import { linesOf } from "./legend.js";
import { placeOfWords, seenPoints, wordsOf } from "./marker_shapes.js";
import { toHex } from "./inputs.js";

const INK = "#141414", HALO = "#fff", PAPER = "#ffffffe0";
const LEAST = 9, LETTERS_HIGH = 34; // pixels of letters, and how many are as high as the shorter side of a picture
const LINE = 1.5, SWATCH = 2.5; // of the legend, in letters

/** Draw on a canvas what marks a scene that a camera sees; with a legend or without. */
export function drawMarks(canvas, scene, camera, hasLegend) {
  const pen = canvas.getContext("2d"), size = Math.max(LEAST, Math.floor(Math.min(canvas.width, canvas.height) / LETTERS_HIGH));
  pen.font = `${size}px system-ui, sans-serif`;
  pen.lineJoin = "round";
  pen.textBaseline = "middle";
  for (const marker of scene.markers) {
    const seen = seenPoints(marker, camera, canvas.width, canvas.height);
    if (seen) drawMarker(pen, seen, wordsOf(marker, scene.space), size, canvas.width);
  }
  const lines = hasLegend ? linesOf(scene) : [];
  if (lines.length) drawLegend(pen, lines, size, canvas);
}

function drawMarker(pen, seen, words, size, width) {
  const rim = Math.max(1, size / 9);
  for (const [color, more] of [[HALO, rim], [INK, 0]]) {
    pen.strokeStyle = pen.fillStyle = color;
    pen.lineWidth = rim + 2 * more;
    pen.stroke(new Path2D(`M${seen.map(({ x, y }) => `${x} ${y}`).join("L")}`));
    for (const { x, y } of seen) {
      pen.beginPath();
      pen.arc(x, y, size / 4 + more, 0, 2 * Math.PI);
      pen.fill();
    }
  }
  const { x, y, anchor } = placeOfWords(seen, pen.measureText(words).width, size, width);
  pen.textAlign = anchor;
  pen.lineWidth = size / 3.5;
  pen.strokeStyle = HALO;
  pen.strokeText(words, x, y);
  pen.fillText(words, x, y);
}

function drawLegend(pen, lines, most, { width, height }) {
  const words = lines.map(({ name, range }) => `${name}  ${range}`.trim());
  const letters = Math.max(...words.map((each) => pen.measureText(each).width)) / most;
  const size = Math.min(most, 0.9 * width / (letters + 5), 0.9 * height / (LINE * lines.length + 1));
  const left = size / 2, top = height - (lines.length * LINE + 1.5) * size;
  pen.font = `${size}px system-ui, sans-serif`;
  pen.textAlign = "start";
  pen.fillStyle = PAPER;
  pen.fillRect(left, top, (letters + 4.5) * size, (lines.length * LINE + 1) * size);
  lines.forEach(({ colors }, row) => {
    const middle = top + (0.5 + (row + 0.5) * LINE) * size, begin = left + size / 2;
    const ramp = pen.createLinearGradient(begin, 0, begin + SWATCH * size, 0), stops = colors.map(toHex);
    stops.forEach((color, i) => ramp.addColorStop(i / Math.max(1, stops.length - 1), color));
    pen.fillStyle = ramp;
    pen.fillRect(begin, middle - 0.4 * size, SWATCH * size, 0.8 * size);
    pen.fillStyle = INK;
    pen.fillText(words[row], left + 3.7 * size, middle);
  });
}
