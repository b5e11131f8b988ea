// Pointer, touch, wheel and keys on a picture move its camera.

const TURN = 0.4; // degrees a CSS pixel
const STEP = 5; // degrees a key
const NOTCH = 0.0015; // of the distance's logarithm, for a pixel of the wheel
const LINE = 16, PAGE = 400; // pixels of a wheel that counts in lines or pages
const AXIS_KEYS = ["+x", "−x", "+y", "−y", "+z", "−z"];

/**
 * @param {HTMLCanvasElement} canvas
 * @param {() => OrbitCamera} camera
 * @param {() => void} moved - is called after each change
 * @param {(name: string) => void} goTo - "home" or a name of AXES
 * @param {() => boolean} isLocked - whether nothing may move
 */
export function control(canvas, camera, moved, goTo, isLocked = () => false) {
  const pointers = new Map();

  canvas.addEventListener("pointerdown", (event) => {
    canvas.setPointerCapture(event.pointerId);
    pointers.set(event.pointerId, event);
  });
  for (const name of ["pointerup", "pointercancel"]) {
    canvas.addEventListener(name, (event) => pointers.delete(event.pointerId));
  }
  canvas.addEventListener("pointermove", (event) => {
    const before = pointers.get(event.pointerId);
    if (!before) return;
    pointers.set(event.pointerId, event);
    if (isLocked()) return;
    const others = [...pointers.values()].filter((each) => each.pointerId !== event.pointerId);
    if (others.length) pinch(camera(), canvas, before, event, others[0]);
    else drag(camera(), canvas, before, event);
    moved();
  });
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    if (isLocked()) return;
    const pixels = event.deltaY * [1, LINE, PAGE][event.deltaMode];
    zoom(camera(), canvas, Math.exp(NOTCH * Math.max(-PAGE, Math.min(PAGE, pixels))), event);
    moved();
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    if (isLocked() || event.ctrlKey || event.metaKey || event.altKey || !press(camera(), event, goTo)) return;
    event.preventDefault();
    moved();
  });
}

/** One pointer: turn, or move with another button or a key. */
function drag(camera, canvas, before, now) {
  const x = now.clientX - before.clientX, y = now.clientY - before.clientY;
  if (now.buttons > 1 || now.shiftKey) camera.pan(x / canvas.clientHeight, y / canvas.clientHeight);
  else camera.orbit(-TURN * x, TURN * y);
}

/** Come nearer, or go away, by a factor; what lies below the pointer, as far away as the target, stays there. */
function zoom(camera, canvas, factor, { clientX, clientY }) {
  const { left, top, width, height } = canvas.getBoundingClientRect(), before = camera.distance;
  camera.dolly(factor);
  const share = 1 - before / camera.distance;
  camera.pan(share * (clientX - left - width / 2) / height, share * (clientY - top - height / 2) / height);
}

/** Two pointers: move with their middle, and come nearer as they part. */
function pinch(camera, canvas, before, now, other) {
  const apart = (each) => Math.hypot(each.clientX - other.clientX, each.clientY - other.clientY);
  camera.dolly(Math.max(apart(before), 1) / Math.max(apart(now), 1));
  const height = 2 * canvas.clientHeight; // the middle moves half as far
  camera.pan((now.clientX - before.clientX) / height, (now.clientY - before.clientY) / height);
}

/** Whether a key moves the camera. */
function press(camera, { key, shiftKey }, goTo) {
  const arrow = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[key];
  if (arrow && shiftKey) camera.pan(arrow[0] / 20, arrow[1] / 20);
  else if (arrow) camera.orbit(-STEP * arrow[0], STEP * arrow[1]);
  else if (key === "+" || key === "=") camera.dolly(1 / 1.1);
  else if (key === "-") camera.dolly(1.1);
  else if (key === "Home") goTo("home");
  else if (AXIS_KEYS[key - 1]) goTo(AXIS_KEYS[key - 1]);
  else return false;
  return true;
}
