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
LEAST = 9  # of letters, pixels
LETTERS_HIGH = 34  # in the shorter side of a picture
SHIFT = 4  # bits of a pixel's fraction, as OpenCV takes places
FARTHEST = 1e6  # pixels from the picture, which OpenCV can still draw to


def length_of(marker: Marker, space: Space | None) -> str:
    """Return the length of a distance in words, in the unit of the volume's file where it is known."""
    if len(marker.points) < 2:
        return ""
    length = dist(*marker.points) * (space.scale if space else 1.0)
    unit = (space.unit or "volume units") if space else "world units"
    return f"{f'{length:.3g}' if length < 999.5 else f'{length:.0f}'} {unit}"


def with_marks(picture: np.ndarray, camera: Camera, scene: Scene, legend: Sequence[Entry] = ()) -> np.ndarray:
    """Return a picture [H, W, 3 or 4], uint8, straight alpha, with a scene's markers and a legend on top.

    Letters are dark with a light rim, so that they can be read on any ground. What has a point behind the
    camera, and a point outside of the picture, are not drawn; without anything to draw it is as it was.
    """
    if not scene.markers and not legend:
        return picture
    height, width = picture.shape[:2]
    over, size = np.full((height, width, 4), CLEAR, np.uint8), max(LEAST, min(height, width) // LETTERS_HIGH)
    drawn = [(each, ends) for each in scene.markers if (ends := _draw_shape(over, camera, each, size))]
    layer, font = Image.fromarray(over), font_of(size)
    for marker, ends in drawn:
        words = " ".join(filter(None, (marker.text, length_of(marker, scene.space))))
        (left, low), (right, high) = min(ends), max(ends)
        fits = right + size + font.getlength(words) < width or right + left < width
        place, anchor = ((right + size, high), "lm") if fits else ((left - size, low), "rm")
        rim = {"stroke_width": size // 7, "stroke_fill": HALO}
        ImageDraw.Draw(layer).text(place, words, INK, font, anchor, **rim)
    if legend:
        _draw_legend(layer, legend, size)
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
    thick = max(1, size // 9)
    for color, rim in ((HALO, thick), (INK, 0)):
        cv2.line(over, ends[0], ends[-1], color, thick + 2 * rim, cv2.LINE_AA, SHIFT)
        for end in ends:
            cv2.circle(over, end, round((size / 4 + rim) * 2**SHIFT), color, cv2.FILLED, cv2.LINE_AA, SHIFT)
    return [(x, y) for x, y in pixels.tolist()]


def _draw_legend(layer: Image.Image, legend: Sequence[Entry], most: int) -> None:
    """Draw a box in the lower left corner, as large as there is room: swatches, names and ranges."""
    words = [f"{each.name}  {each.range}".strip() for each in legend]
    letters = max(map(font_of(most).getlength, words)) / most
    room = 0.9 * layer.width / (letters + 5), 0.9 * layer.height / (1.5 * len(legend) + 1.5)
    size = max(1, int(min(most, *room)))
    left, low, draw, font = 0.5 * size, layer.height - 0.5 * size, ImageDraw.Draw(layer), font_of(size)
    top = low - (1.5 * len(legend) + 1) * size
    draw.rounded_rectangle((left, top, left + (letters + 4.5) * size, low), size / 3, PAPER)
    for row, entry in enumerate(legend):
        middle = top + (1.25 + 1.5 * row) * size
        swatch = Image.fromarray(np.rint(255 * np.array([entry.colors])).astype(np.uint8))
        sides = round(2.5 * size), max(1, round(0.8 * size))
        layer.paste(swatch.resize(sides, Image.Resampling.BILINEAR), (size, round(middle - 0.4 * size)))
        draw.text((left + 3.7 * size, middle), words[row], INK, font, "lm")


def font_of(size: int) -> ImageFont.FreeTypeFont:
    """Return a font with the letters of Europe, whose height is a number of pixels."""
    from matplotlib import get_data_path

    return ImageFont.truetype(str(Path(get_data_path(), "fonts", "ttf", "DejaVuSans.ttf")), size)
