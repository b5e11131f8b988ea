"""Segments of a model: surfels that are edited on their own and have their own variant of the texture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import owners


def labels_of(masks: Sequence[Tensor], n: int) -> Tensor:
    """Number of each surfel's segment [N], int64, counted from 1; 0 where no segment holds it.

    A surfel that several masks hold belongs to the first: later segments get what earlier ones left.

    Args:
        masks: [N] bool of each segment, at least one.
        n: surfels of the model.

    Raises:
        ArgumentError, ShapeError: if a mask is not [N] bool.
    """
    labels = torch.zeros(n, dtype=torch.int64, device=masks[0].device)
    for number, mask in reversed(list(enumerate(masks, start=1))):
        check.shape("segment", mask, "N", N=n)
        if mask.dtype != torch.bool:
            raise ArgumentError(f"segment: expected a mask of type bool, got {mask.dtype}; compare it first")
        labels[mask] = number
    return labels


def with_variants(model: Surfels, labels: Tensor, variants: Sequence[Surfels]) -> Surfels:
    """The model with the texture of each segment taken from its own variant of the model.

    Args:
        model: textured; what no segment holds stays as it is here.
        labels: [N], see `labels_of`.
        variants: of each segment the model with other texels and colours (offsets from the palette), laid out
            alike; with the same tensors as the model's nothing changes.

    Returns:
        The model itself where nothing changes, else one with new texels and colours.
    """
    p = model.parameters
    places, surfel = owners(p)
    of_texel = torch.zeros(len(p["texels"]), dtype=labels.dtype, device=labels.device)
    of_texel[places] = labels[surfel]
    joined: dict[str, Tensor] = {}
    for name, segment in (("texels", of_texel), ("colors", labels)):
        changed = [number for number, own in enumerate(variants, 1) if own.parameters[name] is not p[name]]
        for number in changed:
            mine = segment == number
            joined.setdefault(name, p[name].clone())[mine] = variants[number - 1].parameters[name][mine]
    return replace(model, parameters={**p, **joined}) if joined else model
