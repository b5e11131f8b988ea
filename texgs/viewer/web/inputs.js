// Native inputs that edit one value: they show what the state has, except while they are being used.

export const BURST = 1000; // milliseconds between keys that are one step of the history
let gestures = 0; // from the first input of a control to its change, or to the last of a burst of keys

/** A step of its own, for edits that are one. */
export function newGesture() {
  return ++gestures;
}

/** A step of its own for each use of an input. */
export function gesture(input, edit) {
  let step = 0, isBusy = false, timer = 0;
  const end = () => {
    step = 0;
    isBusy = false;
  };
  input.addEventListener("input", () => {
    clearTimeout(timer);
    isBusy = true;
    step ||= newGesture();
    edit(step);
  });
  input.addEventListener("change", () => { // each arrow key makes one
    isBusy = false;
    timer = setTimeout(end, BURST);
  });
  input.addEventListener("pointerdown", end, { capture: true }); // before what it begins
  input.addEventListener("blur", end); // a value that was typed and typed back makes no "change"
  return { isBusy: () => isBusy };
}

/** An element with properties and children; names with a dash are attributes. */
export function element(tag, properties = {}, ...children) {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(properties)) {
    if (name.includes("-")) made.setAttribute(name, value);
    else made[name] = value;
  }
  made.append(...children);
  return made;
}

/** Replace buttons, or items with some; the one in the place of that with the focus has it then, or the last. */
export function replaceButtons(root, items) {
  const buttons = () => [...root.querySelectorAll("button")], focused = buttons().indexOf(document.activeElement);
  root.replaceChildren(...items);
  if (focused >= 0) buttons().at(Math.min(focused, buttons().length - 1))?.focus();
}

/** With its first letter in upper case. */
export function capital(text) {
  return text[0].toUpperCase() + text.slice(1);
}

/** #rrggbb of a colour in [0, 1]. */
export function toHex(color) {
  const byte = (x) => Math.round(255 * Math.min(1, Math.max(0, x))).toString(16).padStart(2, "0");
  return `#${color.map(byte).join("")}`;
}

/** A colour in [0, 1] of #rrggbb. */
export function fromHex(hex) {
  return [1, 3, 5].map((i) => parseInt(hex.slice(i, i + 2), 16) / 255);
}

const resetButton = (what, reset) => element(
  "button", { type: "button", className: "reset", title: `Reset ${what}`, "aria-label": `Reset ${what}`,
    onclick: reset }, "↺",
);

/** A slider with a number beside it; `edit(value, step)`, and null to reset. "refused": why a number is none. */
export function slider(label, what, { max, most = 1000, unedited = 1, min = 0, step = 0.01 }, edit) {
  const range = element("input", { type: "range", "aria-label": capital(what) });
  const number = element("input", { type: "number", "aria-label": `${capital(what)}, as a number` });
  Object.assign(range, { min, max, step });
  Object.assign(number, { min, max: most, step: "any" });
  const uses = [range, number].map((input) => gesture(input, (step) => {
    if (input.value === "" || !input.validity.valid) return;
    const value = Number(input.value);
    (input === range ? number : range).value = value;
    edit(value, step);
  }));
  const reset = resetButton(what, () => edit(null, 0));
  const row = element("div", { className: "row" }, element("span", { className: "name" }, label), range, number,
    reset);
  let latest = unedited;
  const show = (value) => {
    latest = value;
    if (uses.some((use) => use.isBusy())) return;
    range.value = value;
    number.value = Number(value.toFixed(3));
    reset.disabled = value === unedited;
  };
  number.addEventListener("change", () => {
    if (number.validity.valid) return;
    const detail = `${capital(what)}: expected a number from ${min} to ${most}, got ${number.value || "none"}.`;
    number.dispatchEvent(new CustomEvent("refused", { bubbles: true, detail }));
  });
  number.addEventListener("blur", () => show(latest)); // where it was left empty, or is refused
  for (const input of [range, number]) { // what came while it was in use
    input.addEventListener("change", () => { if (input.validity.valid) show(latest); });
  }
  return { row, show };
}

/** A colour with a button that resets it. */
export function colorInput(label, what, edit) {
  const input = element("input", { type: "color", "aria-label": capital(what) });
  const use = gesture(input, (step) => edit(fromHex(input.value), step));
  const reset = resetButton(what, () => edit(null, 0));
  const row = element("div", { className: "row" }, element("span", { className: "name" }, label), input, reset);
  const show = (color, isEdited) => {
    if (!use.isBusy()) input.value = toHex(color);
    reset.disabled = !isEdited;
  };
  return { row, show };
}

/** A box to tick. */
export function tick(label, edit, properties = {}) {
  const input = element("input", { type: "checkbox", ...properties, onchange: () => edit(input.checked) });
  const row = element("label", { className: "tick" }, input, label);
  return { row, show: (value) => { input.checked = value; } };
}

/** Ask in a dialog that has one input, for a text or a choice; null where none was given. */
export function ask(dialog, value) {
  const input = dialog.querySelector("input, select");
  input.value = value;
  dialog.returnValue = "";
  dialog.showModal();
  input.focus();
  input.select?.();
  return new Promise((resolve) => {
    dialog.onclose = () => resolve(dialog.returnValue ? input.value.trim() : null);
  });
}

/** Save what is at an address on the computer of the browser. */
export function save(href, name) {
  element("a", { href, download: name }).click();
}

/** Save a file on the computer of the browser. */
export function download(blob, name) {
  const address = URL.createObjectURL(blob);
  save(address, name);
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}
