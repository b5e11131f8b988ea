"""A basic model: raw parameters of surfels, and what turns them into geometry, material and colour."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Literal

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.raster import Options

GEOMETRY = ("means", "quats", "scales", "opacities")
MATERIAL = ("ambient", "diffuse", "specular", "shininess")
TEXTURE = ("palette", "texels", "sizes", "offsets")
SHININESS = (1.0, 100.0)  # range of the bounded exponent


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


@dataclass(frozen=True, eq=False)
class Surfels:
    """Raw parameters by name, all float32 on one device.

    - geometry: `means` [N, 3] world units, `quats` [N, 4] wxyz of any length, `scales` [N, 2] natural
      logarithm, `opacities` [N] logit;
    - colour: `sh` [N, K, 3] before shading is known, `colors` [N, 3] (c_ind) with shading;
    - material: `ambient`, `diffuse`, `specular`, `shininess`, raw, [N] or one for all [1];
    - texture: `palette` [3], `texels` [T, 3], `sizes` [N, 2] int32, `offsets` [N] int64; c_ind is then
      palette + colors + texel.

    Raises:
        ShapeError, ArgumentError: if a tensor is missing, unknown or of another shape.
    """

    parameters: Mapping[str, Tensor]
    shading: ShadingModel = field(default_factory=ShadingModel)
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        given = self.parameters
        missing = [name for name in GEOMETRY if name not in given]
        if missing or not ({"sh", "colors"} & set(given)):
            raise ArgumentError(
                f"model: expected {', '.join(GEOMETRY)} and sh or colors, got {', '.join(given)}"
            )
        n = check.shape("means", given["means"], "N 3")["N"]
        for name, spec in SHAPES.items():
            if name in given:
                check.shape(name, given[name], spec, N=n)
        for name in MATERIAL:
            if name in given and given[name].shape not in ((n,), (1,)):
                raise ArgumentError(f"{name}: expected [{n}] or [1], got {list(given[name].shape)}")

    def __len__(self) -> int:
        return len(self.parameters["means"])

    def to(self, device: torch.device | str) -> Surfels:
        """The same model on another device."""
        return replace(self, parameters={name: x.to(device) for name, x in self.parameters.items()})

    @property
    def stage(self) -> Literal["surfels", "shading", "texture"]:
        """The phase that the model has gone through."""
        if "texels" in self.parameters:
            return "texture"
        return "shading" if "ambient" in self.parameters else "surfels"


SHAPES = {
    "means": "N 3",
    "quats": "N 4",
    "scales": "N 2",
    "opacities": "N",
    "sh": "N K 3",
    "colors": "N 3",
    "palette": "3",
    "texels": "T 3",
    "sizes": "N 2",
    "offsets": "N",
}


def geometry(parameters: Mapping[str, Tensor]) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Means, quaternions, standard deviations and opacities as the rasterizer takes them; differentiable."""
    p = parameters
    return p["means"], p["quats"], p["scales"].exp(), p["opacities"].sigmoid()


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
