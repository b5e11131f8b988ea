// A double click makes the point that is seen there what the camera looks at, and turns around.

const GLIDE = 300; // milliseconds

/**
 * @param {ScenePage} page
 * @param {() => boolean} isLocked - whether the camera has to stay
 */
export function centerByDoubleClick(page, isLocked) {
  page.canvas.addEventListener("dblclick", async ({ offsetX, offsetY }) => {
    if (isLocked()) return;
    if (!page.isOfCamera) {
      page.notices.tell("This is a training view. Double click on the scene in another mode to turn around a point.");
      return;
    }
    const point = await pointBelow(page, { offsetX, offsetY });
    if (!point) page.notices.tell("There is only background. Double click on the scene to turn around that point.");
    else if (!isLocked()) glide(page, point);
  });
}

/** The point of the scene [3] that is seen below a pointer; null for the background. */
export function pointBelow({ camera, canvas, renderer, shown, state }, { offsetX, offsetY }) {
  const [width, height] = renderer.size();
  const place = [offsetX * width / canvas.clientWidth, offsetY * height / canvas.clientHeight];
  return renderer.pointAt(camera, state.scene, shown, place.map(Math.floor));
}

/** Move the target to a point, the picture with it; unless something else moves it meanwhile. */
function glide(page, point) {
  const { camera } = page, from = camera.target, begun = performance.now();
  const length = matchMedia("(prefers-reduced-motion: reduce)").matches ? 0 : GLIDE;
  let latest = from;
  const step = (now) => {
    if (camera.target.some((x, i) => x !== latest[i])) return;
    const part = length ? Math.min(1, Math.max(0, (now - begun) / length)) : 1, eased = part * part * (3 - 2 * part);
    camera.place({ target: from.map((x, i) => x + eased * (point[i] - x)) });
    latest = camera.target;
    page.moved();
    if (part < 1) requestAnimationFrame(step);
  };
  requestAnimationFrame(step);
}
