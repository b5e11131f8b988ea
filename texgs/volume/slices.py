"""Slices of a volume along the axes of its file, and what its samples are at places.

Nothing is interpolated: a slice has the samples of the file, and a place is that of the nearest one.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Grid, closest
from texgs.volume.label_masks import HALF
from texgs.volume.space import LETTERS, Triple

PATIENT_PLANES = ("sagittal", "coronal", "axial")  # by the axis of the patient that they lie across
# Of slices across x, y and z: which axis of the file's space is to the right, ahead or behind, and which up,
# as radiologists see a patient, from the left, the front and the feet.
LAYOUT = {
    "LPS": ((1, 1, 2, 1), (0, 1, 2, 1), (0, 1, 1, -1)),
    "RAS": ((1, -1, 2, 1), (0, -1, 2, 1), (0, -1, 1, 1)),
    "xyz": ((1, 1, 2, 1), (0, 1, 2, 1), (0, 1, 1, 1)),
}
Labels = Mapping[str, tuple[int, np.ndarray | None]]  # channel of a mask, and its colour [3]; None: hidden
NO_LABELS: Labels = {}
COVER = 0.6  # of a label over an image


@dataclass(frozen=True)
class SlicePlane:
    """Slices across one axis of the file's space, and how they are shown."""

    name: str  # sagittal, coronal or axial; x, y or z where the space is no patient's
    count: int  # of slices
    axis: tuple[int, int]  # across, of the grid, 0 to 2 for x, y, z; 1 where slices count along it, else -1
    right: tuple[int, int]  # the same of columns
    up: tuple[int, int]  # the same of rows, from the lowest one
    ends: tuple[str, ...]  # what is at the left, right, bottom and top, such as R, L, P, A
    size: tuple[int, int]  # samples to the right and up
    spacing: tuple[float, float]  # of these, in units of the file


@dataclass(frozen=True)
class Place:
    """A sample of a volume."""

    index: tuple[int, int, int]  # along the axes of the file's space, from 0, within the prepared volume
    position: Triple  # in the file's space and unit
    value: float | None  # of the sample; None where there are labels alone
    labels: tuple[str, ...] = ()  # that the sample is in


def planes_of(grid: Grid) -> list[SlicePlane]:
    """Return the planes of slices across x, y and z of the file's space, or the axes closest to these."""
    letters, behind = LETTERS.get(grid.space.name, ("xyz", ""))
    ends = list(zip(behind, letters, strict=True)) if behind else [("", "")] * 3
    names = PATIENT_PLANES if behind else ("x", "y", "z")
    along = closest(grid.space.axes)  # of each axis of the space, the axis of the grid
    planes = []
    for name, across, (right, turn, up, rise) in zip(names, along, LAYOUT[letters], strict=True):
        (column, one), (row, other) = along[right], along[up]
        sides = (column, turn * one), (row, rise * other), (*ends[right][::turn], *ends[up][::rise])
        size, spacing = (grid.dims[column], grid.dims[row]), (grid.spacing[column], grid.spacing[row])
        planes.append(SlicePlane(name, grid.dims[across[0]], across, *sides, size, spacing))
    return planes


def slice_of(grid: Grid, plane: SlicePlane, number: int, channel: int = 0) -> np.ndarray:
    """Return a slice [H, W], row 0 at the top: the file's samples, of its type, as a view.

    Raises:
        ArgumentError: if there is no slice of that number.
    """
    if not 0 <= number < plane.count:
        raise ArgumentError(f"slice: expected {plane.name} from 0 to {plane.count - 1}, got {number}")
    (axis, sign), (right, turn), (up, rise) = plane.axis, plane.right, plane.up
    values = np.moveaxis(grid.channel(channel).values, (2 - up, 2 - right, 2 - axis), (0, 1, 2))
    return values[::-rise, ::turn, number if sign > 0 else plane.count - 1 - number]


def place_at(grid: Grid, point: Sequence[float], labels: Labels = NO_LABELS) -> Place | None:
    """Return the sample closest to a point of the world, or None over half a sample beyond the outermost."""
    dims, steps = np.array(grid.dims), np.array(point) / grid.scale / grid.spacing  # from the middle
    if not (np.abs(steps) <= 0.5 * dims).all():
        return None
    stored = np.rint(steps + 0.5 * (dims - 1)).astype(int).clip(0, dims - 1)
    ways = (stored.tolist(), (dims - 1 - stored).tolist())
    i, j, k = (ways[sign < 0][axis] for axis, sign in closest(grid.space.axes))
    position, at = grid.space.place(grid.origin, (stored * grid.spacing).tolist()), tuple(stored[::-1])
    inside = [name for name, (mask, _) in labels.items() if grid.channel(mask).values[at] >= HALF]
    return Place((i, j, k), position, grid.values[at].item() if has_image(labels) else None, tuple(inside))


def has_image(labels: Labels) -> bool:
    """Return whether the first channel of a volume with labels is no label itself."""
    return all(channel for channel, _ in labels.values())


def point_of(grid: Grid, index: Iterable[int]) -> list[float]:
    """Return the point [3] of the world of a sample, by its index along the axes of the file's space."""
    point = [0.0, 0.0, 0.0]
    for number, (axis, sign) in zip(index, closest(grid.space.axes), strict=True):
        point[axis] = sign * (number - 0.5 * (grid.dims[axis] - 1)) * grid.spacing[axis] * grid.scale
    return point


def windowed(values: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return values as grey levels [H, W], uint8: black up to low, white from high on; NaN is black."""
    shares = (values.astype(np.float64) - low) / max(high - low, float(np.finfo(np.float32).tiny))
    return np.rint(255 * np.nan_to_num(shares).clip(0, 1)).astype(np.uint8)


@lru_cache(maxsize=2)  # all frames of a moving cut have the same
def window_of(grid: Grid) -> tuple[float, float]:
    """Return the values that 99 % of the first channel are between; of every n-th sample along each axis."""
    step = max(grid.dims) // 100 or 1
    samples = grid.values[::step, ::step, ::step]
    low, high = np.quantile(samples, (0.005, 0.995)).tolist()
    return (low, high) if low < high else (float(samples.min()), float(samples.max()))


def slice_colors(values: Callable[[int], np.ndarray], window: Sequence[float], labels: Labels) -> np.ndarray:
    """Return colours [..., 3], uint8: grey levels of the first channel, and labels over them.

    Values [...] are those that a function tells of a channel. Where the first is a label, there is no grey.
    """
    levels, cover = windowed(values(0), *window), COVER
    if not has_image(labels):
        levels, cover = np.zeros_like(levels), 1.0
    colors = np.repeat(levels[..., None], 3, axis=-1)
    for channel, color in labels.values():
        if color is not None:
            inside = values(channel) >= HALF
            colors[inside] = np.rint((1 - cover) * colors[inside] + cover * 255 * color)
    return colors
