// The table of parts: what edits change, one row for each model and for each of its segments behind it.

export const COLUMNS = 4; // texels of 4 floats in a row

/** First row of each model. */
export function firstRows(models) {
  let row = 0;
  return models.map((model) => {
    const first = row;
    row += 1 + model.segments.length;
    return first;
  });
}

/**
 * The rows of all parts [R, COLUMNS, 4]: palette and opacity factor (0 for what is hidden); factors of the
 * material; whether the viewer is near, and whether only the face towards the viewer is lit; tint of highlights.
 *
 * @param {object[]} models of a scene description.
 * @param {object[]} optics of each model.
 * @returns {Float32Array}
 */
export function partTable(models, optics) {
  const rows = models.flatMap((model, number) => [model, ...model.segments].map(({ edit }) => {
    const palette = edit.palette ?? model.fitted_palette ?? [0, 0, 0];
    const factors = [edit.ambient, edit.diffuse, edit.specular, edit.shininess];
    const { local_viewer: isNear, facing } = optics[number];
    return [...palette, edit.visible ? edit.opacity : 0, ...factors, Number(isNear), Number(facing), 0, 0, ...edit.tint, 0];
  }));
  return Float32Array.from(rows.flat());
}
