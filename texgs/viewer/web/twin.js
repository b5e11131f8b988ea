// The volume of a scene beside its models, and behind the faces of cuts, as texgs/scene/cut_view.py has them.

import { Faces } from "./faces.js";
import { Target } from "./target.js";
import { VolumePass } from "./volume_pass.js";

export const OF_TWIN = ["volume", "difference", "wipe"]; // modes
const SLAB = 36; // units of length behind a face, as in texgs/scene/cut_view.py
const STILL = 0.5, MOVING = 1; // voxels between samples

/** Whether a volume can show all edits of models but looks, as `Scene.is_as_volume` has it. */
function isAsVolume(models) {
  const text = JSON.stringify, shown = models.filter(({ edit }) => edit.visible && edit.opacity > 0);
  const isApart = models.some(({ edit, segments }) => segments.some((each) => text(each.edit) !== text(edit)));
  const materials = shown.map(({ edit: { ambient, diffuse, specular, shininess, tint } }) =>
    text([ambient, diffuse, specular, shininess, tint]));
  return !isApart && new Set(materials).size <= 1;
}

/** A picture that nothing is shown beside. */
export const alone = (picture) => ({ first: picture, second: picture, pair: "none" });

export class Twin {
  #volume; #faces; #hasLooks;

  /**
   * @param {WebGL2RenderingContext} gl
   * @param {object} samples see samples.js.
   * @param {object} facts `volume` of the description of a scene.
   */
  constructor(gl, samples, facts) {
    this.#volume = new VolumePass(gl, samples, facts);
    this.#faces = new Faces(gl, this.#volume);
    this.target = new Target(gl, [gl.RGBA32F, gl.RGBA, gl.FLOAT]);
    this.#hasLooks = facts.looks;
  }

  /**
   * The picture of a mode, or two and how they are shown: see PAIRS.
   *
   * @param {object} models - what draws them: `target`, and `draw`, which takes the slab that hides them.
   */
  pictures(view, scene, look, { mode, moving }, models) {
    const step = moving ? MOVING : STILL, shown = mode === "volume" ? scene : { ...scene, functions: {} }; // no others have models
    const cast = (target, slab) => {
      this.#volume.cast(target, view, shown, look, { step, isMoving: moving, ...slab });
      return target.picture;
    };
    const seen = () => {
      if (!look.planes.length) return models.draw();
      if (!this.#hasLooks && isAsVolume(scene.models)) return cast(this.target);
      const slab = { reach: SLAB * this.#volume.unit, weights: this.#faces.weights(view, shown, look) };
      models.draw(slab);
      return cast(models.target, { ...slab, isOver: true });
    };
    if (mode === "volume") return alone(cast(this.target));
    if (mode === "shaded") return alone(seen());
    return { first: seen(), second: cast(this.target), pair: mode };
  }

  /** What of a scene's light reaches cells of its volume, see `VolumeLight`. */
  cells(scene, look, isMoving) {
    return this.#volume.cells({ ...scene, functions: {} }, look, isMoving);
  }

  /** Draw depths of the volume into the target: where half of the light is gone, or if it never is, means. */
  drawDepths(view, scene, look) {
    this.#volume.cast(this.target, view, scene, look, { step: STILL, isDepth: true });
  }
}
