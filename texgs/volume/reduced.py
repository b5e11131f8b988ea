"""Views over white, at their own resolution or a lower one."""

from __future__ import annotations

from dataclasses import replace

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from texgs.core.camera import Camera
from texgs.volume.view_set import View


def over_white(view: View, reduce: int = 1) -> Tensor:
    """Colour over white and alpha [4, H, W], float32."""
    color, alpha = view.image()
    planes = torch.cat([color.permute(2, 0, 1), alpha[None]])
    if reduce > 1:
        planes = avg_pool2d(planes, reduce)
    planes[:3] += 1 - planes[3]
    return planes


def smaller(camera: Camera, reduce: int) -> Camera:
    """The camera of an image reduced by averaging."""
    K = camera.K.clone()
    K[:2] /= reduce
    return replace(camera, K=K, width=camera.width // reduce, height=camera.height // reduce)
