"""A basic model of 3D Gaussians with spherical harmonics."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError, ShapeError
from texgs.core.light import HEADLIGHT, Light
from texgs.fields.field import Role
from texgs.fields.surfels.groups import GEOMETRY
from texgs.fields.surfels.model import geometry
from texgs.fields.unlit import sizes_in_mib
from texgs.raster import Options, Render, rasterize
from texgs.raster.shading import DEGREES, spherical_harmonics

SHAPES = {"means": "N 3", "quats": "N 4", "scales": "N 3", "opacities": "N", "sh": "N K 3"}
PLY_GEOMETRY = 4 * 14  # bytes of one in a PLY file of 3DGS: mean, normal, opacity, scales, quaternion
PLY_SHADING = 4 * 48  # and its harmonics of degree 3


@dataclass(frozen=True)
class Baked:
    """Colours that light has gone into already, as harmonics; and the filter that they were fitted with."""

    antialiased: bool = False  # of the rasterizer, see texgs.raster.Options

    @property
    def options(self) -> Options:
        """For the rasterizer."""
        return Options(antialiased=self.antialiased)

    def colors(self, parameters: Mapping[str, Tensor], camera: Camera, light: Light) -> Tensor:
        """Colours [N, 3] in a view, whatever the light; differentiable."""
        return spherical_harmonics(parameters["sh"], parameters["means"], camera.position)


@dataclass(frozen=True, eq=False)
class Gaussians:
    """Raw parameters by name, as 3DGS has them, all float32 on one device.

    `means` [N, 3] world units, `quats` [N, 4] wxyz of any length, `scales` [N, 3] natural logarithm,
    `opacities` [N] logit, and `sh` [N, K, 3] of degree 0 to 3.

    Raises:
        ShapeError, ArgumentError: if a tensor is missing, unknown or of another shape.
    """

    kind: ClassVar[str] = "gaussians"

    parameters: Mapping[str, Tensor]
    shading: Baked = field(default_factory=Baked)
    metadata: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if set(self.parameters) != set(SHAPES):
            raise ArgumentError(f"model: expected {', '.join(SHAPES)}, got {', '.join(self.parameters)}")
        sizes: dict[str, int] = {}
        for name, axes in SHAPES.items():
            sizes |= check.shape(name, self.parameters[name], axes, **sizes)
        if sizes["K"] not in DEGREES:
            raise ShapeError(f"sh: expected 1, 4, 9 or 16 coefficients, [N, K, 3], got {sizes['K']}")

    def __len__(self) -> int:
        return len(self.parameters["means"])

    @property
    def device(self) -> torch.device:
        """Where its tensors are."""
        return self.parameters["means"].device

    def to(self, device: torch.device | str) -> Gaussians:
        """The same model on another device."""
        return replace(self, parameters={name: x.to(device) for name, x in self.parameters.items()})

    def tensors(self, role: Role) -> dict[str, Tensor]:
        """Parameters of geometry, or the harmonics."""
        is_geometry = role == "geometry"
        return {name: x for name, x in self.parameters.items() if (name in GEOMETRY) == is_geometry}

    def sizes(self) -> dict[str, float]:
        """Return sizes in MiB: as the paper counts, PLY files of 3DGS; `stored_` are those of the tensors."""
        n_geometry, n_shading = (
            sum(x.nbytes for x in self.tensors(role).values()) for role in ("geometry", "appearance")
        )
        return sizes_in_mib(
            {"geometry": PLY_GEOMETRY * len(self), "shading": PLY_SHADING * len(self), "texture": 0},
            {"geometry": n_geometry, "shading": n_shading, "texture": 0},
        )

    def render(
        self,
        camera: Camera,
        light: Light = HEADLIGHT,
        *,
        background: Tensor | None = None,
        outputs: Collection[str] = (),
        opacity: Tensor | float = 1.0,
    ) -> Render:
        """Render the Gaussians.

        Args:
            camera: on the model's device.
            light: changes nothing: the colours are those of the views.
            background: [3]; white by default.
            outputs: of the rasterizer, without "normal".
            opacity: factor on opacities, one or [N]; they stay at most 1.

        Raises:
            ArgumentError: if a normal is asked for.
        """
        means, quats, scales, opacities = geometry(self.parameters)
        return rasterize(
            means,
            quats,
            scales,
            (opacities * opacity).clamp_max(1),
            camera.viewmat,
            camera.K,
            camera.width,
            camera.height,
            features=self.shading.colors(self.parameters, camera, light),
            background=torch.ones_like(camera.viewmat[0, :3]) if background is None else background,
            outputs=outputs,
            options=self.shading.options,
        )
