"""Clicks in the configuration: shares of the sides of a picture, and what finds the object there."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from texgs.core.errors import ArgumentError

MASKS = ("mobile_sam", "sam_vit_h", "grabcut")  # the second is the paper's


def mask_weights(masks: str) -> dict[str, str]:
    """Return the weights of what finds the object, for `Method.weights`."""
    return {} if masks == "grabcut" else {masks: "masks=grabcut"}


def normalized_clicks(name: str, points: Sequence[Any]) -> list[list[float]]:
    """Return clicks as shares of the sides of a picture, checked."""
    for point in points:
        is_pair = isinstance(point, list) and len(point) == 2
        if not is_pair or not all(isinstance(x, int | float) and 0 <= x < 1 for x in point):
            raise ArgumentError(f"{name}: expected two shares from 0 to below 1, got {point}")
    return list(points)
