"""Images as PNG files: straight alpha and 8 bits on disk, premultiplied floats [H, W, C] in memory."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from textwrap import wrap

import cv2
import numpy as np
import torch
from PIL import Image, ImageDraw, ImageFont
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ShapeError
from texgs.core.io import reading, write_bytes
from texgs.core.memory import require_memory

# Pillow opens more: some formats by other programs, which a file should not be able to start.
FORMATS = ("PNG", "JPEG", "WEBP", "GIF", "TIFF", "BMP", "PPM", "JPEG2000", "AVIF", "TGA")
FAST_PNG = (cv2.IMWRITE_PNG_COMPRESSION, 1, cv2.IMWRITE_PNG_FILTER, cv2.IMWRITE_PNG_FILTER_NONE)
BYTES = 32  # bytes of memory for a pixel: as it is stored, in RGBA, and as floats


@contextmanager
def open_picture(path: str | Path, what: str = "an image") -> Iterator[Image.Image]:
    """Open an image file that fits into memory; its header is read now, its pixels when they are used."""
    with reading(path, what), Image.open(path, formats=FORMATS) as picture:
        width, height = picture.size
        require_memory(BYTES * width * height, f"{path}: {what} of {width} x {height} pixels", "reduce it")
        yield picture


def to_pillow(color: Tensor, alpha: Tensor | None = None) -> Image.Image:
    """Round an image [H, W, 3] or [H, W, 1] to 8 bits, clamped to [0, 1] first.

    Where alpha [H, W] is given, colour is premultiplied, and divided by it: the file holds straight alpha.
    """
    if color.ndim != 3 or color.shape[2] not in (1, 3):
        raise ShapeError(f"color: expected [H, W, 3] or [H, W, 1], got {list(color.shape)}")
    check.finite(color=color, alpha=alpha)
    planes = color.detach().float().cpu()
    if alpha is None:
        pixels = _rounded(planes)
        return Image.fromarray(pixels[..., 0] if pixels.shape[2] == 1 else pixels)
    check.shape("alpha", alpha, "H W", H=color.shape[0], W=color.shape[1])
    cover = alpha.detach().float().cpu()[..., None]
    straight = planes * torch.where(cover > 0, 1 / cover.clamp_min(1e-12), 0.0)
    return Image.fromarray(np.concatenate([_rounded(straight.expand(-1, -1, 3)), _rounded(cover)], axis=2))


def _rounded(planes: Tensor) -> np.ndarray:
    """Return the values in [0, 1] as 8 bits, those beyond clamped."""
    return (planes * 255).clamp_(0, 255).round_().to(torch.uint8).numpy()


def with_caption(picture: np.ndarray, words: str) -> np.ndarray:
    """Return a picture [H, W, 3], uint8, with words below it, as large as its width has room for."""
    width = picture.shape[1]
    size = max(10, width // 36)
    lines = wrap(words, max(1, 2 * (width - size) // size))
    strip = Image.new("RGB", (width, (len(lines) + 1) * round(1.3 * size)), "white")
    place, font = (size // 2, size // 2), ImageFont.load_default(size)
    ImageDraw.Draw(strip).multiline_text(place, "\n".join(lines), "black", font)
    return np.concatenate([picture, np.asarray(strip)])


def write_png(path: str | Path, color: Tensor, alpha: Tensor | None = None) -> Path:
    """Write an image as PNG in one step; arguments as for `to_pillow`.

    OpenCV writes it without filters at the lowest level: in a third of the time of Pillow's default, with
    a third more bytes for views of volumes.
    """
    pixels = np.asarray(to_pillow(color, alpha))
    if pixels.ndim == 3:
        pixels = cv2.cvtColor(pixels, cv2.COLOR_RGBA2BGRA if pixels.shape[2] == 4 else cv2.COLOR_RGB2BGR)
    _, encoded = cv2.imencode(".png", pixels, FAST_PNG)
    return write_bytes(path, encoded.tobytes())


def with_eight_bits(picture: Image.Image) -> Image.Image:
    """Return the picture, its grey values of 16 bits rounded to 8: Pillow's conversion would clip them."""
    if not picture.mode.startswith("I"):
        return picture
    return Image.fromarray((np.asarray(picture) / 257).round().clip(0, 255).astype(np.uint8))


def read_rgba(path: str | Path) -> np.ndarray:
    """Return the pixels of an image as stored: [H, W, 4] uint8, straight alpha; 255 where it has none."""
    with open_picture(path) as picture:
        return np.array(with_eight_bits(picture).convert("RGBA"))
