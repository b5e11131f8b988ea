"""The colours of surfels in a view: shading model, material, lights and viewer."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.geometry import quats_to_matrices
from texgs.core.light import Light
from texgs.fields.surfels.material import RANGES, require_material
from texgs.raster import Options, Texture
from texgs.raster.shading import MATERIAL, Ranges, between, blinn_phong, spherical_harmonics

FAR_DISTANCE = 1e4  # world units; from so far away, all surfels are seen from one direction
MIN_SHARE = 1e-6  # least share of ambient or diffuse light, to keep its logit finite


@dataclass(frozen=True)
class ShadingModel:
    """The options of a fit that belong to the model."""

    low_pass: float = 6.0  # option of the rasterizer, see texgs.raster.Options
    material: Literal["bounded", "paper"] = "bounded"  # mapping of raw material to factors
    local_viewer: bool = True  # whether each surfel has its own direction to viewer and headlight
    facing: bool = True  # whether lights shine on the side that faces the viewer, or on both

    @property
    def options(self) -> Options:
        """Options of the rasterizer."""
        return Options(low_pass=self.low_pass)

    def colors(self, parameters: Mapping[str, Tensor], camera: Camera, light: Light) -> Tensor | Texture:
        """Return colours [N, 3] of the surfels in a view, or a texture with base and gain; differentiable."""
        p = parameters
        if "ambient" not in p:
            return spherical_harmonics(p["sh"], p["means"], camera.position)
        colors = p["colors"] + p["palette"] if "texels" in p else p["colors"]
        raw, ranges = (p[name] for name in MATERIAL), RANGES[self.material]
        base, gain = self.lit(colors, raw, p, camera, light, ranges)  # clamped, as in volume renderers
        return Texture(base, gain, p["texels"], p["sizes"], p["offsets"]) if "texels" in p else base

    def lit(
        self,
        colors: Tensor,
        factors: Iterable[Tensor],
        p: Mapping[str, Tensor],
        camera: Camera,
        light: Light,
        ranges: Ranges | None = None,
    ) -> tuple[Tensor, Tensor]:
        """Return base [N, 3] and gain [N] of surfels with parameters `p`; the rest is as in `blinn_phong`.

        A viewer who is not local is far behind the camera. Normals of their own come before those of surfels.
        """
        viewer = camera.position if self.local_viewer else -FAR_DISTANCE * camera.viewmat[2, :3]
        toward = None if light.kind == "headlight" else light.direction(camera).to(camera.viewmat)
        turns = p.get("normals", p["quats"])
        a, d, s, b = factors
        means, facing = p["means"], self.facing
        return blinn_phong(colors, a, d, s, b, means, turns, viewer, toward, facing=facing, ranges=ranges)


def seen_normals(parameters: Mapping[str, Tensor], camera: Camera) -> Tensor:
    """Return the unit normals [N, 3] for shading, on the side that faces a camera."""
    normals = quats_to_matrices(parameters.get("normals", parameters["quats"]))[..., 2]
    along = (normals * (camera.position - parameters["means"])).sum(dim=1, keepdim=True)
    return torch.where(along < 0, -normals, normals)


def material(parameters: Mapping[str, Tensor], kind: str) -> dict[str, Tensor]:
    """Return factors k_a, k_d, k_s and beta by name, [N] or [1]; differentiable.

    Factors with a range, see `RANGES`, go through a sigmoid; others are used unchanged.
    """
    ranges = RANGES[kind]
    return {
        name: between(*ranges[name], parameters[name]) if name in ranges else parameters[name]
        for name in MATERIAL
    }


def raw_material(
    ambient: float, diffuse: float, specular: float, shininess: float, kind: str
) -> dict[str, Tensor]:
    """Invert `material` for one material, [1] each, whose factors the kind must be able to express."""
    factors = dict(zip(MATERIAL, (ambient, diffuse, specular, shininess), strict=True))
    require_material(factors, kind)
    raw = {name: torch.tensor([factor]) for name, factor in factors.items()}
    for name, (low, high) in RANGES[kind].items():
        raw[name] = ((raw[name] - low) / (high - low)).logit()
    return raw


def in_full_light(parameters: Mapping[str, Tensor], kind: str) -> dict[str, Tensor]:
    """Scale the colours of surfels so that k_a + k_d is 1, without changing any view.

    Views cannot tell brighter colours from more light. A colour is then what is seen where light falls
    straight onto a surface, as in a transfer function. Materials without ranges of k_a and k_d stay.
    """
    if not {"ambient", "diffuse"} <= RANGES[kind].keys():
        return dict(parameters)
    factors = material(parameters, kind)
    light = factors["ambient"] + factors["diffuse"]  # [N] or [1]
    scaled = {name: (factors[name] / light).logit(eps=MIN_SHARE) for name in ("ambient", "diffuse")}
    return {**parameters, **scaled, "colors": parameters["colors"] * light[:, None]}
