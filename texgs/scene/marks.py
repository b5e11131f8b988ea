"""What is drawn on top of pictures: markers, distances with their lengths, and a legend."""

from collections.abc import Sequence
from math import dist
from pathlib import Path

import cv2
import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont

from texgs.core.camera import Camera
from texgs.core.markers import Marker
from texgs.scene.legend import Entry
from texgs.scene.scene import Scene
from texgs.volume.space import Space

INK, HALO, CLEAR, PAPER = (20, 20, 20, 255), (255, 255, 255, 255), (255, 255, 255, 0), (255, 255, 255, 225)
LEAST_SIZE = 9  # of letters, pixels
LETTERS_HIGH = 34  # in the shorter side of a picture
SHIFT = 4  # bits of a pixel's fraction, as OpenCV takes places
FARTHEST = 1e6  # pixels from the picture, which OpenCV can still draw to


def length_of(marker: Marker, space: Space | None) -> str:
    """Return the length of a distance in words, in the unit of the volume's file where it is known."""
    if len(marker.points) < 2:
        return ""
    length = dist(*marker.points) * (space.scale if space else 1.0)
    unit = (space.unit or "volume units") if space else "world units"
    return f"{f'{length:.3g}' if length < 1000 else f'{length:.0f}'} {unit}"


def with_marks(picture: np.ndarray, camera: Camera, scene: Scene, legend: Sequence[Entry] = ()) -> np.ndarray:
    """Return a picture [H, W, 3 or 4], uint8, straight alpha, with a scene's markers and a legend on top.

    Letters are dark with a light rim, so that they can be read on any ground. What has a point behind the
    camera, and a point outside of the picture, are not drawn; without anything to draw it is as it was.
    """
    if not scene.markers and not legend:
        return picture
    height, width = picture.shape[:2]
    over, size = (
        np.full((height, width, 4), CLEAR, np.uint8),
        max(LEAST_SIZE, min(height, width) // LETTERS_HIGH),
    )
    drawn = {each: ends for each in scene.markers if (ends := _draw_shape(over, camera, each, size))}
    layer, font = Image.fromarray(over), font_of(size)
    draw = ImageDraw.Draw(layer)
    for marker, ends in drawn.items():
        words = " ".join(filter(None, (marker.text, length_of(marker, scene.space))))
        (left, low), (right, high) = min(ends), max(ends)
        fits = right + size + font.getlength(words) < width or right + left < width
        place = (right + size, high) if fits else (left - size, low)
        draw.text(place, words, INK, font, "lm" if fits else "rm", stroke_width=size // 7, stroke_fill=HALO)
    if legend:
        _draw_legend(draw, legend, size, width, height)
    whole = Image.fromarray(picture).convert("RGBA")
    whole.alpha_composite(layer)
    return np.array(whole)[..., : picture.shape[2]]


def _draw_shape(over: np.ndarray, camera: Camera, marker: Marker, size: int) -> list[tuple[float, float]]:
    """Draw a marker, and return the pixels of its points; none where it is not seen."""
    pixels, depth = camera.project(torch.tensor(marker.points, dtype=torch.float64))
    inside = (pixels >= 0) & (pixels < pixels.new_tensor([camera.width, camera.height]))
    if not (depth > 0).all() or not inside.all(dim=1).any() or pixels.abs().max() > FARTHEST:
        return []
    ends = [tuple(round((x - 0.5) * 2**SHIFT) for x in pixel) for pixel in pixels.tolist()]
    rim, radius, thick = max(1, size // 9), size / 4, max(1, size // 9)
    for color, more in ((HALO, rim), (INK, 0)):
        cv2.line(over, ends[0], ends[-1], color, thick + 2 * more, cv2.LINE_AA, SHIFT)
        for end in ends:
            cv2.circle(over, end, round((radius + more) * 2**SHIFT), color, cv2.FILLED, cv2.LINE_AA, SHIFT)
    return [(x, y) for x, y in pixels.tolist()]


def _draw_legend(
    draw: ImageDraw.ImageDraw, legend: Sequence[Entry], size: int, width: int, height: int
) -> None:
    """Draw a box in the lower left corner, as large as there is room: swatches, names and ranges."""
    letters = max(font_of(size).getlength(each.words) for each in legend) / size
    size = int(min(size, 0.9 * width / (letters + 5), 0.9 * height / (1.5 * len(legend) + 1)))
    font, step = font_of(size), 1.5 * size
    left, top = 0.5 * size, height - (len(legend) * step + 1.5 * size)
    draw.rounded_rectangle(
        (left, top, left + (letters + 4.5) * size, height - 0.5 * size), size / 3, PAPER, HALO
    )
    for row, entry in enumerate(legend):
        middle, edges = (
            top + 0.5 * size + (row + 0.5) * step,
            np.linspace(1, 3.5, len(entry.colors) + 1) * size,
        )
        for color, start, stop in zip(entry.colors, edges[:-1], edges[1:], strict=True):
            box = (
                left + start - 0.5 * size,
                middle - 0.4 * size,
                left + stop - 0.5 * size,
                middle + 0.4 * size,
            )
            draw.rectangle(box, tuple(round(255 * x) for x in color))
        draw.text((left + 3.7 * size, middle), entry.words, INK, font, "lm")


def font_of(size: int) -> ImageFont.FreeTypeFont:
    """Return a font with the letters of Europe, whose height is a number of pixels."""
    from matplotlib import get_data_path

    return ImageFont.truetype(str(Path(get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")), size)
