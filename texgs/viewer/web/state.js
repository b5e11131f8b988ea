// A scene that is edited: its description, and the history of its edits. It knows no server.
// Edits are {part, key, value}: part is "TF01" or "TF01/segment", or "" for what is edited of the
// whole scene; value null takes an edit back.

import { toHex } from "./inputs.js";

const UNEDITED = {
  visible: true, palette: null, opacity: 1, ambient: 1, diffuse: 1, specular: 1, shininess: 1,
  tint: [1, 1, 1],
};
const MOST_STEPS = 200; // of the history: of more, the oldest cannot be undone
const MOST_NAMED = 3; // markers in the title of a step
const OF_SCENE = {
  light: null, shadows: 0, occlusion: 0, reach: 0.25, background: [1, 1, 1],
  cuts: { planes: [], box: null, faces: "shaded" }, functions: {}, markers: [], time: null,
};

/** Numbers of the steps in time that can be shown: all, or those that a page holds. */
export const timesOf = ({ steps, held }) => held ?? [...steps.keys()];

/** Another description, with an edit made. */
export function edited(scene, { part, key, value }) {
  if (part === "") return { ...scene, [key]: value ?? OF_SCENE[key] };
  const change = (each) => ({ ...each, edit: { ...each.edit, [key]: value ?? UNEDITED[key] } });
  const inModel = (model) => ({
    ...model,
    segments: model.segments.map((each) => `${model.name}/${each.name}` === part ? change(each) : each),
  });
  return { ...scene, models: scene.models.map((m) => m.name === part ? change(m) : inModel(m)) };
}

/** The edits that make one description another, as far as it has the same parts, or beside them with `others`. */
export function difference(from, to, others = false) {
  const edits = [], same = (one, other) => JSON.stringify(one) === JSON.stringify(other);
  for (const key of Object.keys(OF_SCENE)) {
    if (!same(from[key], to[key])) edits.push({ part: "", key, value: to[key] });
  }
  const parts = partsOf(from);
  for (const [part, edit] of partsOf(to)) {
    const before = parts.get(part) ?? (others ? UNEDITED : edit);
    for (const [key, value] of Object.entries(edit)) {
      if (!same(before[key], value)) edits.push({ part, key, value });
    }
  }
  return edits;
}

/** Edits by the names of parts. */
export function partsOf(scene) {
  return new Map(scene.models.flatMap((model) => [
    [model.name, model.edit],
    ...model.segments.map((each) => [`${model.name}/${each.name}`, each.edit]),
  ]));
}

/** What the list of steps calls an edit. */
export function titleOf({ part, key, value }, scene) {
  if (key === "functions") return titleOfFunctions(scene, value ?? {});
  const ofScene = { cuts: titleOfCuts, markers: titleOfMarkers };
  const title = value && ofScene[key] ? ofScene[key](value) : titleOfValue(value);
  return `${part} ${key} ${title}`.trim();
}

/** What a step changes of functions: which ones, and whether they are new or gone, or their points. */
function titleOfFunctions({ tfs, functions: before }, after) {
  const names = Object.keys({ ...before, ...after });
  const changed = names.filter((name) => JSON.stringify(before[name]) !== JSON.stringify(after[name]));
  return `functions ${changed.map((name) => titleOfFunction(name, before[name] ?? tfs[name], after[name])).join(", ")}`.trim();
}

function titleOfFunction(name, before, after) {
  if (!after) return `${name} reset`;
  if (!before) return `${name} new`;
  const words = ["opacity", "color"].filter((key) => JSON.stringify(before[key]) !== JSON.stringify(after[key]))
    .map((key) => titleOfPoints({ opacity: "opacity", color: "colour" }[key], before[key], after[key]));
  return `${name} ${words.length > 1 ? "moved" : words.join("")}`.trim();
}

function titleOfPoints(word, before, after) {
  if (before.length !== after.length) return `${word}, point ${before.length < after.length ? "added" : "removed"}`;
  const index = after.findIndex((point, i) => JSON.stringify(point) !== JSON.stringify(before[i]));
  return `${word} at ${Number(after[index][0].toPrecision(3))}`;
}

function titleOfCuts({ planes, box, faces }) {
  const count = planes.length, words = count ? [count > 1 ? `${count} planes` : "1 plane"] : [];
  if (box) words.push("box");
  if (words.length && faces !== "shaded") words.push(faces);
  return words.join(", ") || "none";
}

function titleOfMarkers(markers) {
  if (markers.length > MOST_NAMED) return `${markers.length}`;
  return markers.map(({ text, points }) => text || (points.length > 1 ? "distance" : "point")).join(", ") || "none";
}

function titleOfValue(value) {
  if (value === null) return "reset";
  if (typeof value === "boolean") return value ? "on" : "off";
  if (Array.isArray(value)) return toHex(value);
  if (Number.isInteger(value) || typeof value === "string") return `${value}`;
  if (typeof value === "number") return `${Number(value.toPrecision(4))}`;
  return Object.entries(value).map(([key, angle]) => `${key} ${Math.round(angle)}°`).join(", ");
}

/** Whether a value of an edit changes nothing. */
export function isUnedited(key, value) {
  return String(value) === String(UNEDITED[key]);
}

/** Dispatches "change" whenever something of it is another, and "edit" before somebody changes the scene here. */
export class State extends EventTarget {
  #scenes = []; // before each step of `past`, and after each of `future`
  #undone = [];
  #latest = null; // part, key and number of a step that may go on

  constructor(scene) {
    super();
    this.scene = this.original = scene;
    this.past = []; // names of steps, oldest first
    this.future = []; // names of steps that were taken back, the next one first
    this.saved = true;
  }

  /** Make an edit; those with the same number in a row are one step, such as those of a slider. */
  edit(part, key, value, step = 0) {
    this.dispatchEvent(new Event("edit"));
    const latest = step ? `${step} ${part} ${key}` : null;
    const goesOn = latest !== null && latest === this.#latest, edit = { part, key, value };
    if (!goesOn) this.#scenes = [...this.#scenes, this.scene].slice(-MOST_STEPS);
    const past = [...(goesOn ? this.past.slice(0, -1) : this.past), titleOf(edit, this.scene)].slice(-MOST_STEPS);
    this.#undone = [];
    this.#latest = latest;
    this.update({ scene: edited(this.scene, edit), past, future: [], saved: false });
  }

  /** Take the latest step back. */
  undo() {
    if (!this.past.length) return;
    this.dispatchEvent(new Event("edit"));
    this.#latest = null;
    this.#undone.push(this.scene);
    const name = this.past.at(-1);
    const scene = this.#scenes.pop();
    this.update({ scene, past: this.past.slice(0, -1), future: [name, ...this.future] });
  }

  /** Make the step again that was taken back last. */
  redo() {
    if (!this.future.length) return;
    this.dispatchEvent(new Event("edit"));
    this.#latest = null;
    this.#scenes.push(this.scene);
    const [name, ...future] = this.future;
    this.update({ scene: this.#undone.pop(), past: [...this.past, name], future });
  }

  /** Set some of scene, past, future and saved. */
  update(values) {
    Object.assign(this, values);
    this.dispatchEvent(new Event("change"));
  }
}
