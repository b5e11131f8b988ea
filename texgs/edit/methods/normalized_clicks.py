"""Clicks in the configuration: shares of the sides of a picture, and what finds the object there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from texgs.core.errors import ArgumentError

MASKS = ("mobile_sam", "sam_vit_h", "grabcut")  # the second is the paper's


def mask_weights(masks: str) -> dict[str, str]:
    """Weights of what finds the object, for `Method.weights`."""
    return {} if masks == "grabcut" else {masks: "masks=grabcut"}


def shares(name: str, points: Sequence[Any]) -> list[list[float]]:
    """Clicks as shares of the sides of a picture."""
    for point in points:
        is_pair = isinstance(point, list) and len(point) == 2
        if not is_pair or not all(isinstance(x, int | float) and 0 <= x < 1 for x in point):
            raise ArgumentError(f"{name}: expected two shares from 0 to below 1, got {point}")
    return list(points)
