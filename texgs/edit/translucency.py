"""How translucent a scene is, as its views show it."""

from __future__ import annotations

from collections.abc import Sequence

import torch

from texgs.core.camera import Camera
from texgs.edit.canvas import around, splatted
from texgs.fields.surfels.model import Surfels

VIEWS = 6  # looked at


@torch.no_grad()
def mean_alpha(model: Surfels, cameras: Sequence[Camera]) -> float:
    """Mean alpha in [0, 1] of the pixels of a few views, each weighted by its alpha; 1 where nothing shows.

    Weighted so, pixels at the rim of an opaque object hardly count, and the background does not at all.

    Args:
        model: any stage.
        cameras: of views that are spread around the model, on any device.
    """
    total = square = 0.0
    for camera in cameras[:: -(-len(cameras) // VIEWS)]:
        part = around(model, camera.to(model.device))
        alpha = splatted(model, part, 1.0, features=model.parameters["means"][:, :1]).alpha
        total, square = total + float(alpha.sum()), square + float(alpha.square().sum())
    return square / total if total > 0 else 1.0
