"""Segments of a model: surfels that are edited on their own, and take their texels from their own variant."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.scene.model import Model
from texgs.scene.texels import owners


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


def with_variants(model: Model, labels: Tensor, texels: Sequence[Tensor]) -> Model:
    """The model with the texels of each segment taken from its own list; all lists are laid out alike.

    Args:
        model: textured; its texels are those of what no segment holds.
        labels: [N], see `labels_of`.
        texels: [T, 3] of each segment; the same tensor as the model's means that nothing changes.

    Returns:
        The model itself where nothing changes, else one with a new list of texels.
    """
    p = model.parameters
    changed = [number for number, own in enumerate(texels, start=1) if own is not p["texels"]]
    if not changed:
        return model
    joined = p["texels"].clone()
    places, surfel = owners(p)
    segment = labels[surfel]
    for number in changed:
        mine = places[segment == number]
        joined[mine] = texels[number - 1][mine]
    return replace(model, parameters={**p, "texels": joined})
