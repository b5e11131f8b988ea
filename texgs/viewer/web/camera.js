// A camera that looks at a target from a distance, and what moves it.
// Axes are those of texgs.core.camera: world +y up, azimuth 0 at +x and -90 at +z; x right, y down, z forward.

import { numbersOf } from "./link.js";

const DEGREE = Math.PI / 180;
const NEAREST = 0.05, FARTHEST = 30; // distances from the target, in radii of the scene
const KEYS = ["azimuth", "polar", "distance", "fov_y"];

export const AXES = {
  "+x": [0, 0], "−x": [180, 0], "+y": [-90, 90], "−y": [-90, -90], "+z": [-90, 0], "−z": [90, 0],
};

/** Unit vector to (azimuth, polar), degrees. */
export function direction(azimuth, polar) {
  const a = azimuth * DEGREE, p = polar * DEGREE;
  return [Math.cos(a) * Math.cos(p), Math.sin(p), -Math.sin(a) * Math.cos(p)];
}

/** Azimuth and polar angle of a vector, degrees. */
export function angles([x, y, z]) {
  return { azimuth: Math.atan2(-z, x) / DEGREE, polar: Math.atan2(y, Math.hypot(x, z)) / DEGREE };
}

/** An angle in [-180, 180). */
export function wrapped(angle) {
  return angle - 360 * Math.floor((angle + 180) / 360);
}

const clamp = (value, low, high) => Math.min(high, Math.max(low, value));
export const dot = (a, b) => a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
export const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];

export class OrbitCamera {
  /** @param {object} scene - a description, whose first view is the camera's */
  constructor(scene) {
    this.radius = scene.bounds.radius;
    this.home = { fov_y: scene.fov_y, ...scene.views[0] };
    this.place(this.home);
  }

  /** Go to the first view, as far away as a picture of this width and height needs. */
  goHome(width, height) {
    this.place({ ...this.home, distance: this.home.distance * Math.max(1, height / Math.max(width, 1)) });
  }

  /** Go somewhere; what is not named stays. */
  place({ target, azimuth, polar, distance, fov_y }) {
    this.target = [...(target ?? this.target)];
    this.azimuth = wrapped(azimuth ?? this.azimuth);
    this.polar = clamp(polar ?? this.polar, -90, 90);
    this.distance = clamp(distance ?? this.distance, NEAREST * this.radius, FARTHEST * this.radius);
    this.fov_y = clamp(fov_y ?? this.fov_y, 1, 150);
  }

  /** Turn around the target, degrees. */
  orbit(azimuth, polar) {
    this.place({ azimuth: this.azimuth + azimuth, polar: this.polar + polar });
  }

  /** Move so that what is at the target follows the pointer; parts of the picture's height. */
  pan(x, y) {
    const { right, down } = this.axes();
    const height = 2 * this.distance * Math.tan(this.fov_y / 2 * DEGREE), far = FARTHEST * this.radius;
    this.target = this.target.map((t, i) => clamp(t - height * (x * right[i] + y * down[i]), -far, far));
  }

  /** Multiply the distance. */
  dolly(factor) {
    this.place({ distance: this.distance * factor });
  }

  /** Unit vectors of the image in the world. */
  axes() {
    const a = this.azimuth * DEGREE, p = this.polar * DEGREE;
    const forward = direction(this.azimuth, this.polar).map((x) => -x);
    const up = [-Math.cos(a) * Math.sin(p), Math.cos(p), Math.sin(a) * Math.sin(p)]; // defined at the poles
    const right = cross(forward, up);
    return { right, down: cross(forward, right), forward };
  }

  /** World to camera, three rows of four. */
  viewmat() {
    const { right, down, forward } = this.axes();
    const position = this.target.map((t, i) => t - this.distance * forward[i]);
    return [right, down, forward].map((axis) => [...axis, -dot(axis, position)]);
  }

  /** Where a point is in a picture of this size, and how many pixels one of its units has; behind: less than 0. */
  project(point, width, height) {
    const [x, y, z] = this.viewmat().map((row) => dot(row, point) + row[3]);
    const scale = height / 2 / Math.tan(this.fov_y / 2 * DEGREE) / z;
    return { x: width / 2 + scale * x, y: height / 2 + scale * y, scale };
  }

  /** The point that a place in a picture of this size shows at a depth. */
  unproject([x, y], depth, width, height) {
    const { right, down, forward } = this.axes(), unit = 2 * depth * Math.tan(this.fov_y / 2 * DEGREE) / height;
    return this.target.map((t, i) => t + (depth - this.distance) * forward[i]
      + unit * ((x - width / 2) * right[i] + (y - height / 2) * down[i]));
  }

  /** Where it is, as `place` takes it. */
  get pose() {
    const { target, azimuth, polar, distance, fov_y } = this;
    return { target, azimuth, polar, distance, fov_y };
  }

  /** As a renderer of frames needs it. */
  wire(width, height) {
    return { ...this.pose, width, height };
  }

  /** As options of `texgs render`. */
  options(width, height) {
    const { target, azimuth, polar, distance, fov_y } = this;
    const values = { azimuth, polar, radius: distance, fov: fov_y, width, height };
    const words = Object.entries(values).map(([name, value]) => `--${name} ${round(value)}`);
    return [`--target ${target.map(round).join(" ")}`, ...words].join(" ");
  }

  /** As a part of a link. */
  toFragment() {
    const values = KEYS.map((key) => `${key}=${round(this[key])}`);
    return [...values, `target=${this.target.map(round).join(",")}`].join("&");
  }

  /** Go where the words of a link say; what is none of a camera is added to `wrong`. */
  follow(words, wrong) {
    const ofOne = (key) => [key, numbersOf(words, key, 1, wrong)?.[0]];
    this.place({ ...Object.fromEntries(KEYS.map(ofOne)), target: numbersOf(words, "target", 3, wrong) });
  }
}

const round = (value) => Number(value.toFixed(4));
