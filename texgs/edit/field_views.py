"""A field of any kind as a guidance sees it: as it looks, with its light, and where each pixel lies."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.fields.field import Field
from texgs.models.guidance import EditViews
from texgs.raster.normals import depth_to_normal


@torch.no_grad()
def field_views(
    field: Field, cameras: Sequence[Camera], conditions: Tensor, level: float | None = None
) -> EditViews:
    """Render views of a field for a guidance.

    Points are those of the mean depth, and normals those of the surface that they make: fields without
    surfaces have no others.

    Args:
        field: that can render depth.
        cameras: of one size, on the field's device.
        conditions: [V, H, W, 3] what edits stay close to.
        level: of noise, see `EditViews`.
    """
    images, alphas, points, normals = [], [], [], []
    for camera in cameras:
        seen = field.render(camera, outputs=("depth",))
        assert seen.depth is not None
        images.append(seen.color.clamp(0, 1))
        alphas.append(seen.alpha)
        points.append(camera.unproject(seen.depth))
        is_seen = (seen.alpha > 0)[..., None]
        normals.append(depth_to_normal(seen.depth, camera.viewmat, camera.K) * is_seen)
    return EditViews(
        torch.stack(images),
        conditions,
        torch.stack(alphas),
        torch.stack(points),
        torch.stack(normals),
        list(cameras),
        level,
    )
