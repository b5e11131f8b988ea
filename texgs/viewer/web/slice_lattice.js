// Where the samples of a volume are, in its slices and in the world. An index counts slices of each plane, from 0.

const clamp = (value, most) => Math.min(most, Math.max(0, value));

export class SliceLattice {
  #lengths; // by the axes of the grid: samples, and world units between two

  /** @param {object[]} planes - across the three axes of the file's space, as `planes_of` of texgs has them */
  constructor(planes) {
    this.planes = planes;
    const spacing = [];
    for (const { right, up, spacing: [width, height] } of planes) {
      spacing[right[0]] = width;
      spacing[up[0]] = height;
    }
    const counts = spacing.map((_, axis) => planes[this.#across(axis)].count);
    const longest = Math.max(...spacing.map((step, axis) => step * (counts[axis] - 1))); // it is 1 in the world
    this.#lengths = spacing.map((step, axis) => ({ count: counts[axis], step: step / longest }));
  }

  /** The index nearest to the middle. */
  get middle() {
    return this.planes.map(({ count }) => Math.floor(count / 2));
  }

  /** The nearest index of a sample. */
  within(index) {
    return index.map((number, i) => clamp(Math.round(number), this.planes[i].count - 1));
  }

  /** The point of the world [3] of a sample. */
  pointOf(index) {
    const point = [];
    this.planes.forEach(({ axis: [axis, sign] }, i) => {
      const { count, step } = this.#lengths[axis];
      point[axis] = sign * (index[i] - (count - 1) / 2) * step;
    });
    return point;
  }

  /** The index of the sample that is nearest to a point of the world. */
  nearest(point) {
    return this.within(this.planes.map(({ axis: [axis, sign] }) => {
      const { count, step } = this.#lengths[axis];
      return sign * point[axis] / step + (count - 1) / 2;
    }));
  }

  /** Column and row, from the left and the top, of a sample in its slice of a plane. */
  pixelOf(plane, index) {
    const [column, row] = this.#sides(plane).map(({ across, sign, count }) =>
      sign > 0 ? index[across] : count - 1 - index[across]);
    return [column, plane.size[1] - 1 - row];
  }

  /** The index of a column and a row in the slice of a plane that another sample is in. */
  indexAt(plane, [column, row], index) {
    const found = [...index], places = [column, plane.size[1] - 1 - row];
    this.#sides(plane).forEach(({ across, sign, count }, i) => {
      found[across] = sign > 0 ? places[i] : count - 1 - places[i];
    });
    return this.within(found);
  }

  /** Which plane lies across an axis of the grid. */
  #across(axis) {
    return this.planes.findIndex((plane) => plane.axis[0] === axis);
  }

  /** For columns and rows, from the lowest: which number of an index they are, and whether they count along it. */
  #sides({ right, up }) {
    return [right, up].map(([axis, sign]) => {
      const across = this.#across(axis), { axis: [, along], count } = this.planes[across];
      return { across, sign: sign * along, count };
    });
  }
}
