"""A model as a guidance sees it: images, alpha, and where in the world each pixel lies."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.fields.splats import geometry
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import light_direction, material, viewer
from texgs.models.guidance import EditViews
from texgs.raster import Texture, rasterize
from texgs.raster.shading import blinn_phong_texture


def require_texture(model: Surfels) -> None:
    """Require a textured model."""
    if model.stage != "texture":
        raise ArgumentError(f"model: expected stage texture, got {model.stage}; fit its texture first")


def light_on(model: Surfels, camera: Camera, light: Light | None) -> tuple[Tensor, Tensor]:
    """Highlight [N, 3] and gain [N]: a fragment of bare colour c looks like highlight + gain * c.

    Args:
        model: relightable.
        camera: of the view.
        light: that shines on the surfels; without one, colours look as they are.
    """
    p, shading = model.parameters, model.shading
    black = torch.zeros_like(p["means"])
    if light is None:
        return black, torch.ones_like(p["opacities"])
    a, d, s, b = material(p, shading.material).values()
    return blinn_phong_texture(
        black,
        a,
        d,
        s,
        b,
        p["means"],
        p["quats"],
        viewer(camera, shading),
        light_direction(light, camera),
        facing=shading.facing,
    )


@torch.no_grad()
def render_views(
    model: Surfels,
    colors: Tensor,
    cameras: Sequence[Camera],
    light: Light | None,
    conditions: Tensor | None = None,
) -> EditViews:
    """Render a model with other colours of its texels for a guidance.

    Args:
        model: textured.
        colors: [T, 3] bare colours.
        cameras: of one size, on the model's device.
        light: or None for bare colours.
        conditions: [V, H, W, 3] of the views returned; what is rendered now, by default.
    """
    sizes = {(camera.width, camera.height) for camera in cameras}
    if len(sizes) != 1:
        raise ArgumentError(f"cameras: expected at least one, all of one size, got sizes {sorted(sizes)}")
    p = model.parameters
    images, alphas, points, normals = [], [], [], []
    for camera in cameras:
        highlight, gain = light_on(model, camera, light)
        seen = rasterize(
            *geometry(p),
            camera.viewmat,
            camera.K,
            camera.width,
            camera.height,
            texture=Texture(highlight, gain, colors, p["sizes"], p["offsets"]),
            background=torch.ones_like(colors[0]),
            outputs=("depth", "normal"),
            options=model.shading.options,
        )
        images.append(seen.color.clamp(0, 1))
        alphas.append(seen.alpha)
        points.append(camera.unproject(seen.depth))  # type: ignore[arg-type]
        normals.append(seen.normal)
    shown = torch.stack(images)
    return EditViews(
        shown,
        shown if conditions is None else conditions,
        torch.stack(alphas),
        torch.stack(points),
        torch.stack(normals),  # type: ignore[arg-type]
        list(cameras),
    )
