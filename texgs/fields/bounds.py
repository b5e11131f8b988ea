"""Where surfels, or 3D Gaussians, are on screen."""

from __future__ import annotations

from collections.abc import Mapping
from math import ceil, floor, isfinite

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.raster import Options
from texgs.volume.images import Box, Images, Target

REACH = 3.34  # standard deviations at which opacity 1 has fallen to 1/255, below which nothing is drawn


@torch.no_grad()
def screen_box(parameters: Mapping[str, Tensor], options: Options, camera: Camera) -> Box:
    """A box around the projected bounding spheres of all surfels or 3D Gaussians. Waits for a GPU once.

    The whole image where a sphere reaches behind the camera, or a value is not finite.
    """
    whole = Box(0, 0, camera.width, camera.height)
    means = parameters["means"]
    if not len(means):
        return Box(camera.width // 2, camera.height // 2, camera.width // 2, camera.height // 2)
    viewmat = camera.viewmat.to(means.device)
    x, y, z = (means @ viewmat[:3, :3].T + viewmat[:3, 3]).unbind(dim=1)
    reach = REACH * parameters["scales"].amax(dim=1).exp()
    near, far = z - reach, z + reach
    bounds = [near.min()]
    for at in (x, y):
        low, high = at - reach, at + reach
        bounds += [torch.minimum(low / near, low / far).min(), torch.maximum(high / near, high / far).max()]
    nearest, left, right, top, bottom = torch.stack(bounds).tolist()
    if not isfinite(sum((nearest, left, right, top, bottom))) or nearest <= 0:
        return whole
    (fx, cx), (fy, cy) = camera.K[0, ::2].tolist(), camera.K[1, 1:].tolist()
    is_flat = parameters["scales"].shape[1] == 2
    variance = 1 / max(options.low_pass, 1e-6) if is_flat else options.dilation
    disc = REACH * variance**0.5  # of the low-pass filter, pixels
    return Box(
        floor(fx * left + cx - disc),
        floor(fy * top + cy - disc),
        ceil(fx * right + cx + disc),
        ceil(fy * bottom + cy + disc),
    )


def visible_part(images: Images, index: int, parameters: Mapping[str, Tensor], options: Options) -> Target:
    """The part of a view in which it or the surfels show anything, on the surfels' device."""
    around = screen_box(parameters, options, images.cameras[index])
    return images.target(index, parameters["means"].device, around)
