"""Checks of the layout of surfel textures in their common list of texels."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.raster.types import Texture

MOST_TEXELS = 2**24  # of one surfel: the library counts them in 32-bit floats


def check_texture(texture: Texture, n: int) -> None:
    """Require a layout for n surfels. Where textures lie is checked on the CPU only; a GPU would wait.

    Raises:
        ArgumentError, ShapeError, DeviceError: naming the field, or the first two textures that overlap.
    """
    check.shape("texture.texels", texture.texels, "T 3")
    check.shape("texture.sizes", texture.sizes, "N 2", N=n)
    check.shape("texture.offsets", texture.offsets, "N", N=n)
    layout = {"texture.sizes": texture.sizes, "texture.offsets": texture.offsets}
    for (name, x), dtype in zip(layout.items(), (torch.int32, torch.int64), strict=True):
        if x.dtype != dtype:
            raise ArgumentError(f"{name}: expected {dtype}, got {x.dtype}; convert it with .to({dtype})")
    check.same_device(**{"texture.texels": texture.texels}, **layout)
    if n and texture.sizes.device.type == "cpu":
        columns, rows = texture.sizes.unbind(1)
        counts = columns.long() * rows  # [N]
        # An offset beyond the texels is wrong by whatever amount; clamped, the sum cannot overflow.
        ends = texture.offsets.clamp(max=len(texture.texels)) + counts
        _check_range(texture, counts, ends)
        _check_overlap(texture.offsets, ends)


def _check_range(texture: Texture, counts: Tensor, ends: Tensor) -> None:
    smallest, first, end = int(texture.sizes.min()), int(texture.offsets.min()), int(ends.max())
    if smallest < 1 or first < 0 or end > len(texture.texels):
        raise ArgumentError(
            f"texture: expected sizes of at least 1 and textures within the {len(texture.texels)} texels, "
            f"got sizes from {smallest}, offsets from {first} and a last texel at {end - 1}"
        )
    if (most := int(counts.max())) > MOST_TEXELS:
        raise ArgumentError(f"texture.sizes: expected at most 2^24 texels for one surfel, got {most}")


def _check_overlap(offsets: Tensor, ends: Tensor) -> None:
    if bool((offsets[1:] >= ends[:-1]).all()):  # one surfel after the other, as most atlases are
        return
    order = offsets.argsort(stable=True)
    overlaps = (offsets[order][1:] < ends[order][:-1]).nonzero()
    if len(overlaps):
        first, second = order[overlaps[0, 0] :][:2].tolist()
        raise ArgumentError(
            f"texture: expected texels of its own for every surfel, got surfels {first} and {second} "
            f"sharing texel {int(offsets[second])}; give each a copy"
        )
