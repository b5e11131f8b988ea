"""A picture of slices through a place of a volume, with a crosshair, and words about the place."""

from collections.abc import Sequence
from functools import partial

import cv2
import numpy as np
from PIL import Image, ImageDraw, ImageFont

from texgs.core.errors import ArgumentError
from texgs.core.image import with_caption
from texgs.volume.grid import Grid
from texgs.volume.slice_keys import SliceKeys
from texgs.volume.slices import (
    NO_LABELS,
    Labels,
    Place,
    SlicePlane,
    place_at,
    planes_of,
    point_of,
    slice_colors,
    slice_of,
    window_of,
)
from texgs.volume.space import LETTERS
from texgs.volume.view_settings import LARGEST

CROSS, LETTER, LETTER_SIZE = "#f2b134", "#8ab8ff", 16  # colours, and pixels
GAP = 6  # pixels between pictures, and around letters


def slice_picture(grid: Grid, keys: SliceKeys, labels: Labels) -> np.ndarray:
    """Return a picture [H, W, 3], uint8, of a slice, or of all three side by side; pixels are square.

    Raises:
        ArgumentError: if there is no such plane or slice, or the place is beyond the volume.
    """
    planes = {plane.name: plane for plane in planes_of(grid)}
    if keys.plane not in planes and (keys.plane, keys.number) != ("all", None):
        raise ArgumentError(f"slice: expected all, or a number of {', '.join(planes)}, got {keys.plane}")
    index = dict(zip(planes, sample_at(grid, keys.at).index, strict=True))
    if keys.number is not None:
        index[keys.plane] = keys.number
    seen = [planes[keys.plane]] if keys.plane in planes else [*planes.values()]
    sides = np.array([plane.size for plane in seen]) * [plane.spacing for plane in seen]
    gaps, left = GAP * (len(seen) - 1), 0
    scale = min((keys.width - gaps) / sides[:, 0].sum(), LARGEST / sides[:, 1].max())
    sizes = np.rint(scale * sides).astype(int).clip(1)
    picture = Image.new("RGB", (sizes[:, 0].sum() + gaps, sizes[:, 1].max()))
    window, point = keys.window or window_of(grid), point_of(grid, index.values())
    for plane, (width, height) in zip(seen, sizes.tolist(), strict=True):
        colors = slice_colors(partial(slice_of, grid, plane, index[plane.name]), window, labels)
        drawn = marked(colors, plane, (width, height), [x / grid.scale for x in point])
        picture.paste(drawn, (left, (picture.height - height) // 2))
        left += width + GAP
    numbers = ", ".join(f"{name} {number}" for name, number in index.items())
    return with_caption(np.asarray(picture), f"{numbers}; {words_at(grid, point, labels)}")


def marked(pixels: np.ndarray, plane: SlicePlane, size: tuple[int, int], at: Sequence[float]) -> Image.Image:
    """Return a slice in another size, with the letters of its ends, and a crosshair off its middle."""
    way = cv2.INTER_NEAREST_EXACT if size[0] >= plane.size[0] else cv2.INTER_AREA
    picture = Image.fromarray(cv2.resize(pixels, size, interpolation=way))
    draw, (width, height), (right, turn), (up, rise) = ImageDraw.Draw(picture), size, plane.right, plane.up
    x = (0.5 + turn * at[right] / (plane.size[0] * plane.spacing[0])) * width
    y = (0.5 - rise * at[up] / (plane.size[1] * plane.spacing[1])) * height
    draw.line((0, y, width, y), CROSS)
    draw.line((x, 0, x, height), CROSS)
    font = ImageFont.load_default(LETTER_SIZE)
    ends = ((GAP, height / 2), (width - GAP, height / 2), (width / 2, height - GAP), (width / 2, GAP))
    for letter, end, anchor in zip(plane.ends, ends, ("lm", "rm", "md", "ma"), strict=True):
        draw.text(end, letter, LETTER, font, anchor, stroke_width=1, stroke_fill="black")
    return picture


def sample_at(grid: Grid, at: Sequence[float] | None = None, labels: Labels = NO_LABELS) -> Place:
    """Return the sample closest to a place [3] in the space of the file; by default the middle one.

    Raises:
        ArgumentError: if it is beyond the volume.
    """
    place = place_at(grid, (0, 0, 0) if at is None else grid.world.in_world(np.array(at)).tolist(), labels)
    if place is None:
        low, high = grid.world.points(np.array(grid.aabb)).round(4).tolist()
        raise ArgumentError(f"at: expected a place in the volume, from {low} to {high}, got {at}")
    return place


def words_at(grid: Grid, point: Sequence[float], labels: Labels) -> str:
    """Return words about the sample at a point of the world: its place, value and labels."""
    letters, words = LETTERS.get(grid.space.name, ("XYZ", ""))[0], list[str]()
    if place := place_at(grid, point, labels):
        where = ", ".join(f"{letter} {x:.4g}" for letter, x in zip(letters, place.position, strict=True))
        value = [] if place.value is None else [f"value {place.value:g}"]
        words = [f"{where} {grid.space.unit}".rstrip(), *value, *place.labels]
    return "; ".join(words)
