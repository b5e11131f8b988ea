"""Views over white, at their own resolution or a lower one."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.volume.view_set import View


def over_white(view: View, reduce: int = 1) -> Tensor:
    """Colour over white and alpha [4, H, W], float32.

    On one thread, and without torch: views are read by several threads, or beside the work on another one.
    """
    planes = np.ascontiguousarray(view.load().numpy().transpose(2, 0, 1)).astype(np.float32)
    planes /= 255
    planes[:3] *= planes[3]
    if reduce > 1:
        height, width = planes.shape[1] // reduce, planes.shape[2] // reduce
        planes = np.stack(
            [cv2.resize(plane, (width, height), interpolation=cv2.INTER_AREA) for plane in planes]
        )
    planes[:3] += 1 - planes[3]
    return torch.from_numpy(planes)


def smaller(camera: Camera, reduce: int) -> Camera:
    """The camera of an image reduced by averaging."""
    K = camera.K.clone()
    K[:2] /= reduce
    return replace(camera, K=K, width=camera.width // reduce, height=camera.height // reduce)
