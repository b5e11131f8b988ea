"""The picture of a style, read at a useful size, with the region that counts."""

import warnings
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Self

import numpy as np
import torch
from PIL import ExifTags, Image, ImageOps
from torch import Tensor
from torch.nn import functional as F

from texgs.core import check
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.image import open_picture, with_eight_bits
from texgs.core.memory import require_memory

MIN_SIDE = 32  # pixels of the shorter side; a smaller picture holds no pattern
MAX_SIDE = 2048  # pixels of the longer side; larger pictures are reduced
BYTES_PER_PIXEL = 32  # bytes of memory for a pixel of a scaled style
Find = Callable[[Tensor], Tensor]


@dataclass(frozen=True, eq=False)
class StylePicture:
    """A style: a picture and the region of it that counts."""

    image: Tensor  # [3, h, w] in [0, 1]; outside the region, its nearest colours
    region: Tensor  # [h, w] bool

    def __post_init__(self) -> None:
        size = check.shape("image", self.image, "3 h w")
        check.shape("region", self.region, "h w", h=size["h"], w=size["w"])
        if not bool(self.region.any()):
            raise ArgumentError(
                "region: expected a part of the style picture, got none of it; choose another"
            )

    @classmethod
    def of(cls, image: Tensor, region: Tensor | None = None) -> Self:
        """Make a style of an image [3, h, w], cropped to the box around the region [h, w], by default all."""
        size = check.shape("image", image, "3 h w")
        if min(size["h"], size["w"]) < MIN_SIDE:
            raise ArgumentError(
                f"style: expected a picture of at least {MIN_SIDE} x {MIN_SIDE} pixels, got {size['w']} x "
                f"{size['h']}; it holds no pattern to carry over"
            )
        if region is None:
            return cls(image, torch.ones_like(image[0], dtype=torch.bool))
        check.shape("region", region, "h w", h=size["h"], w=size["w"])
        cls(image, region)
        rows, columns = (region.any(dim=d).nonzero()[:, 0] for d in (1, 0))
        box = (slice(int(rows[0]), int(rows[-1]) + 1), slice(int(columns[0]), int(columns[-1]) + 1))
        return cls(fill_outside(image[:, *box], region[box]), region[box])

    @property
    def mean(self) -> Tensor:
        """Return the mean colour [3] of the region."""
        return self.pixels.mean(0)

    @property
    def pixels(self) -> Tensor:
        """Return the colours [n, 3] of the region."""
        return self.image.permute(1, 2, 0)[self.region]

    def scaled(self, long_side: float) -> "StylePicture":
        """Resize the style to a longer side in pixels, keeping the aspect; averages pixels to shrink."""
        height, width = self.region.shape
        factor = long_side / max(height, width)
        size = [max(MIN_SIDE // 2, round(factor * x)) for x in (height, width)]
        if size == [height, width]:
            return self
        what = f"a style of {size[1]} x {size[0]} pixels"
        require_memory(BYTES_PER_PIXEL * size[0] * size[1], what, "make edit.image.pattern smaller")
        image = F.interpolate(self.image[None], size, mode="bicubic", antialias=True)[0].clamp(0, 1)
        region = F.interpolate(self.region[None, None].float(), size, mode="area")[0, 0] > 0.5
        return StylePicture(image, region if bool(region.any()) else torch.ones_like(region))

    def vivid(self, gain: float) -> Self:
        """Multiply the differences of the colours from grey by a gain, as far as [0, 1] permits."""
        grey = self.image.mean(0)
        return replace(self, image=(grey + gain * (self.image - grey)).clamp(0, 1))

    def to(self, device: torch.device | str) -> "StylePicture":
        """Return the same on another device."""
        return StylePicture(self.image.to(device), self.region.to(device))


def read_style(path: str | Path, find: Find | None = None) -> StylePicture:
    """Read a style picture: PNG, JPEG, WebP, GIF, TIFF, BMP and more; transparent pixels do not count.

    Args:
        path: of the file. A picture of more than 2,048 pixels along its longer side is reduced to that, and
            one of a camera is turned as its file says.
        find: returns the part that counts, [h, w] bool, of the whole picture [h, w, 3], such as the mask of
            an object in it; by default all.
    """
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Image.DecompressionBombWarning)
            with open_picture(path, "a picture") as picture:
                small = shrink_picture(picture)
    except ArgumentError as error:
        if isinstance(error.__cause__, Image.DecompressionBombError):
            raise ArgumentError(
                f"{path}: expected a picture of at most 178 million pixels; scale it down"
            ) from error
        raise
    pixels = torch.from_numpy(np.asarray(small, dtype=np.float32) / 255).permute(2, 0, 1)
    visible = pixels[3] > 0.5
    if find is not None:
        region = find(pixels[:3].permute(1, 2, 0))
        check.shape("region", region, "h w", h=visible.shape[0], w=visible.shape[1])
        visible = visible & region
    with errors_at(path):
        return StylePicture.of(pixels[:3].contiguous(), None if bool(visible.all()) else visible)


def shrink_picture(picture: Image.Image) -> Image.Image:
    """Return a picture upright, as RGBA, with at most 2,048 pixels along its longer side.

    A very narrow picture keeps more, so that its shorter side still holds a pattern.
    """
    orientation = picture.getexif().get(ExifTags.Base.Orientation, 1)
    scale = min(1.0, max(MAX_SIDE / max(picture.size), MIN_SIDE / min(picture.size)))
    width, height = (max(1, round(scale * side)) for side in picture.size)
    picture.draft("RGB", (2 * width, 2 * height))  # JPEG files are decoded at a lower resolution
    picture = with_eight_bits(picture)
    if picture.mode in ("P", "1", "PA"):
        picture = picture.convert("RGBA")
    factor = max(1, min(picture.width // (2 * width), picture.height // (2 * height)))
    coarse = picture.reduce(factor) if factor > 1 else picture  # before it is converted, to save memory
    small = coarse.convert("RGBA").resize((width, height), Image.Resampling.LANCZOS)
    small.getexif()[ExifTags.Base.Orientation] = orientation
    return ImageOps.exif_transpose(small)


def fill_outside(image: Tensor, region: Tensor) -> Tensor:
    """Fill pixels of an image [3, h, w] outside the region [h, w] with the nearest colour inside."""
    from scipy.ndimage import distance_transform_edt

    nearest = distance_transform_edt(~region.cpu().numpy(), return_distances=False, return_indices=True)
    rows, columns = (torch.from_numpy(x).long().to(image.device) for x in nearest)
    return image[:, rows, columns]


def mirrored_crop(image: Tensor, top: int, left: int, height: int, width: int) -> Tensor:
    """Crop [3, height, width] from the plane covered by an image and its repeated mirror images."""

    def indices(start: int, count: int, size: int) -> Tensor:
        at = (start + torch.arange(count, device=image.device)) % (2 * size)
        return torch.where(at < size, at, 2 * size - 1 - at)

    return image[:, indices(top, height, image.shape[1])][:, :, indices(left, width, image.shape[2])]
