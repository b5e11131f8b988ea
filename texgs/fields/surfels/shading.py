"""How surfels get their colours in a view: the shading model, its material, lights and the viewer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.raster import Options, Texture
from texgs.raster.shading import MATERIAL, blinn_phong, blinn_phong_texture
from texgs.raster.spherical_harmonics import spherical_harmonics

SHININESS = (1.0, 100.0)  # range of the bounded exponent
FAR = 1e4  # world units: a viewer so far away sees all surfels from one direction


@dataclass(frozen=True)
class ShadingModel:
    """What belongs to a model because it was fitted with it."""

    low_pass: float = 6.0  # of the rasterizer, see texgs.raster.Options
    material: Literal["bounded", "paper"] = "bounded"  # how raw material becomes factors
    local_viewer: bool = True  # whether directions to viewer and headlight differ from surfel to surfel
    facing: bool = True  # whether lights shine on the side that faces the viewer, or on both

    @property
    def options(self) -> Options:
        """For the rasterizer."""
        return Options(low_pass=self.low_pass)

    def colors(self, parameters: Mapping[str, Tensor], camera: Camera, light: Light) -> Tensor | Texture:
        """Colours [N, 3] of the surfels in a view, or their texture with base and gain; differentiable."""
        p = parameters
        if "ambient" not in p:
            return spherical_harmonics(p["sh"], p["means"], camera.position)
        a, d, s, b = material(p, self.material).values()
        rest = (a, d, s, b, p["means"], p["quats"], viewer(camera, self), light_direction(light, camera))
        if "texels" not in p:  # clamped as renderers of volumes do
            return blinn_phong(p["colors"], *rest, facing=self.facing).clamp(0, 1)
        base, gain = blinn_phong_texture(p["colors"] + p["palette"], *rest, facing=self.facing)
        return Texture(base.clamp(0, 1), gain, p["texels"], p["sizes"], p["offsets"])


def material(parameters: Mapping[str, Tensor], kind: str) -> dict[str, Tensor]:
    """Factors k_a, k_d, k_s and beta by name, [N] or [1]; differentiable.

    "bounded": factors in (0, 1), exponent in (1, 100). "paper": k_a and k_d as they are, k_s in (0, 5),
    exponent in (0, 50), which is what the release does.
    """
    a, d, s, b = (parameters[name] for name in MATERIAL)
    if kind == "paper":
        factors = (a, d, 5 * s.sigmoid(), 50 * b.sigmoid())
    else:
        low, high = SHININESS
        factors = (a.sigmoid(), d.sigmoid(), s.sigmoid(), low + (high - low) * b.sigmoid())
    return dict(zip(MATERIAL, factors, strict=True))


def raw_material(
    ambient: float, diffuse: float, specular: float, shininess: float, kind: str
) -> dict[str, Tensor]:
    """The inverse of `material` for one material, [1] each.

    Raises:
        ArgumentError: if a factor is outside what the kind can express.
    """
    low, high = SHININESS
    given = torch.tensor([ambient, diffuse, specular, shininess])
    if kind == "paper":
        linear, shares = given[:2], given[2:] / torch.tensor([5.0, 50.0])
    else:
        linear, shares = given[:0], torch.cat([given[:3], (given[3:] - low) / (high - low)])
    if not ((shares > 0) & (shares < 1)).all():
        raise ArgumentError(f"material: expected factors that {kind!r} can express, got {given.tolist()}")
    raw = torch.cat([linear, shares.logit()])
    return dict(zip(MATERIAL, raw[:, None], strict=True))


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
