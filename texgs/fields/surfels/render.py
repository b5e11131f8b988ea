"""How a basic model looks in a view."""

from __future__ import annotations

from collections.abc import Collection, Mapping

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.surfels.model import ShadingModel, Surfels, geometry, material
from texgs.raster import Render, Texture, rasterize
from texgs.raster.shading import blinn_phong, blinn_phong_texture
from texgs.raster.spherical_harmonics import spherical_harmonics

FAR = 1e4  # world units: a viewer so far away sees all surfels from one direction


def viewer(camera: Camera, shading: ShadingModel) -> Tensor:
    """Place [3] that directions to the viewer lead to: the camera, or far behind it for a distant viewer."""
    if shading.local_viewer:
        return camera.position
    return -FAR * camera.viewmat[2, :3]


def light_direction(light: Light, camera: Camera) -> Tensor | None:
    """Direction to the light [3]; None for one at the viewer."""
    if light.kind == "headlight":
        return None
    return light.direction(camera).to(camera.viewmat)


def shaded(
    parameters: Mapping[str, Tensor], shading: ShadingModel, camera: Camera, light: Light
) -> Tensor | Texture:
    """Colours [N, 3] of the surfels in a view, or their texture with base and gain; differentiable."""
    p = parameters
    if "ambient" not in p:
        return spherical_harmonics(p["sh"], p["means"], camera.position)
    a, d, s, b = material(p, shading.material).values()
    rest = (a, d, s, b, p["means"], p["quats"], viewer(camera, shading), light_direction(light, camera))
    if "texels" not in p:
        return blinn_phong(p["colors"], *rest, facing=shading.facing).clamp(
            0, 1
        )  # as renderers of volumes do
    base, gain = blinn_phong_texture(p["colors"] + p["palette"], *rest, facing=shading.facing)
    return Texture(base.clamp(0, 1), gain, p["texels"], p["sizes"], p["offsets"])


def render(
    model: Surfels,
    camera: Camera,
    light: Light = HEADLIGHT,
    *,
    background: Tensor | None = None,
    outputs: Collection[str] = (),
) -> Render:
    """Render a model.

    Args:
        model: any stage; before shading its colours are spherical harmonics and `light` does not count.
        camera: on the model's device.
        light: shines on the surfels.
        background: [3]; white by default.
        outputs: of the rasterizer.
    """
    colored = shaded(model.parameters, model.shading, camera, light)
    kind = "texture" if isinstance(colored, Texture) else "features"
    return rasterize(
        *geometry(model.parameters),
        camera.viewmat,
        camera.K,
        camera.width,
        camera.height,
        background=torch.ones_like(camera.viewmat[0, :3]) if background is None else background,
        outputs=outputs,
        options=model.shading.options,
        **{kind: colored},  # type: ignore[arg-type]
    )
