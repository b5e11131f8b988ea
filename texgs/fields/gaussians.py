"""3D Gaussians with spherical harmonics (Kerbl et al. 2023, 3DGS): scenes and files."""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import ClassVar

import torch
from torch import Tensor
from torch.nn.functional import pad

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError, ShapeError, errors_at
from texgs.core.io import reading_as
from texgs.core.light import Light
from texgs.core.ply_file import is_ply, read_vertices
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.field import Asked, UnlitScene, sizes_in_mib
from texgs.fields.part_edit import MAX_OPACITY, PartEdit, opacity_factors
from texgs.fields.ply_columns import Told, splat_columns, take_geometry, take_harmonics, write_columns
from texgs.fields.splats import Splats
from texgs.raster import Options, Render
from texgs.raster.shading import DEGREES, spherical_harmonics

SHAPES = {"means": "N 3", "quats": "N 4", "scales": "N 3", "opacities": "N", "sh": "N K 3"}
PLY_GEOMETRY = 4 * 14  # bytes in a PLY file of 3DGS: mean, normal, opacity, scales, quaternion
PLY_SHADING = 4 * 48  # bytes of harmonics of degree 3
FORMAT = "texgs-gaussians"
VERSION = 1
HARMONICS = 16  # coefficients of degree 3, as programs for PLY files expect


@dataclass(frozen=True)
class Baked:
    """Colours with baked light, as harmonics, and the filter of their fit."""

    antialiased: bool = False  # of the rasterizer, see texgs.raster.Options

    @property
    def options(self) -> Options:
        """Options of the rasterizer."""
        return Options(antialiased=self.antialiased)

    def colors(self, parameters: Mapping[str, Tensor], camera: Camera, light: Light) -> Tensor:
        """Return colours [N, 3] in a view, independent of the light; differentiable."""
        return spherical_harmonics(parameters["sh"], parameters["means"], camera.position)


@dataclass(frozen=True, eq=False)
class Gaussians(Splats):
    """Raw parameters by name as in 3DGS, all float32 on one device.

    `means` [N, 3] world units, `quats` [N, 4] wxyz of any length, `scales` [N, 3] natural logarithm,
    `opacities` [N] logit, and `sh` [N, K, 3] of degree 0 to 3.

    Raises:
        ShapeError, ArgumentError: if a tensor is missing, unknown or of another shape.
    """

    kind: ClassVar[str] = "gaussians"

    shading: Baked = field(default_factory=Baked)

    def __post_init__(self) -> None:
        if set(self.parameters) != set(SHAPES):
            raise ArgumentError(f"model: expected {', '.join(SHAPES)}, got {', '.join(self.parameters)}")
        sizes: dict[str, int] = {}
        for name, axes in SHAPES.items():
            sizes |= check.shape(name, self.parameters[name], axes, **sizes)
        if sizes["K"] not in DEGREES:
            raise ShapeError(f"sh: expected 1, 4, 9 or 16 coefficients, [N, K, 3], got {sizes['K']}")

    def sizes(self) -> dict[str, float]:
        """Return sizes in MiB: of PLY files of 3DGS, as in the paper; `stored_` of the tensors."""
        n_geometry, n_shading = (
            sum(x.nbytes for x in self.tensors(role).values()) for role in ("geometry", "appearance")
        )
        return sizes_in_mib(
            {"geometry": PLY_GEOMETRY * len(self), "shading": PLY_SHADING * len(self), "texture": 0},
            {"geometry": n_geometry, "shading": n_shading, "texture": 0},
        )


class JoinedGaussians(UnlitScene[Gaussians]):
    """Models as one scene on one device, see `UnlitScene`; joined once, sorted and blended together."""

    def __init__(self, models: Sequence[Gaussians], segments: Sequence[Sequence[Tensor]] = ()) -> None:
        super().__init__(models, segments)
        if len({model.shading for model in models}) > 1:
            raise ArgumentError("models: expected all antialiased or none, got both; fit them by one recipe")
        self.whole = join_models(models)

    def _blend(self, factors: Sequence[float], camera: Camera, asked: Asked) -> Render:
        return self.whole.render(camera, opacity=self._per_gaussian(factors), **asked._asdict())

    def with_edits(self, edits: Sequence[PartEdit]) -> Gaussians:
        """Return the visible Gaussians as one model, with edited opacities."""
        factors = self._per_gaussian(opacity_factors(edits, len(self.counts), self.kind))
        shown = factors > 0
        if not bool(shown.any()):
            raise ArgumentError("models: expected at least one visible Gaussian, got none; show a model")
        parameters = {name: x[shown] for name, x in self.whole.parameters.items()}
        raw, factor = parameters["opacities"], factors[shown]
        changed = (raw.sigmoid() * factor).clamp_max(MAX_OPACITY).logit()
        parameters["opacities"] = torch.where(factor == 1, raw, changed)
        return replace(self.whole, parameters=parameters)

    def _per_gaussian(self, factors: Sequence[float]) -> Tensor:
        """Return the factor [N] on each Gaussian's opacity; 0 hides it."""
        pairs = zip(factors, self.counts, strict=True)
        return torch.cat([torch.full((n,), factor, device=self.device) for factor, n in pairs])


def join_models(models: Sequence[Gaussians]) -> Gaussians:
    """Join models into one; missing harmonics are zero."""
    most = max(model.parameters["sh"].shape[1] for model in models)
    several = [
        {**model.parameters, "sh": pad(sh := model.parameters["sh"], (0, 0, 0, most - sh.shape[1]))}
        for model in models
    ]
    parameters = {name: torch.cat([each[name] for each in several]) for name in SHAPES}
    return Gaussians(parameters, models[0].shading)


def write_gaussians(path: str | Path, model: Gaussians) -> Path:
    """Create or replace a model file in one step; the same model gives the same bytes.

    A safetensors file with the raw tensors under their names. Its header has one entry, "texgs-gaussians":
    JSON with `version`, `filter` and `metadata`.
    Metadata must be JSON: tuples come back as lists, keys as text.
    """
    with errors_at(path):
        _require_finite_float32(model)
    shading, metadata = asdict(model.shading), dict(model.metadata)
    description = {"version": VERSION, "filter": shading, "metadata": metadata}
    return write_tensor_file(path, FORMAT, description, model.parameters)


def read_gaussians(path: str | Path) -> Gaussians:
    """Read a file of `write_gaussians`, or a PLY file, to the CPU; nothing in it is executed."""
    path = Path(path)
    if is_ply(path):
        return read_ply(path)
    description, tensors = read_tensor_file(path, FORMAT, VERSION)
    with errors_at(path), reading_as("filter and metadata in the header", "write the file again"):
        shading = Baked(**description["filter"])
        if not isinstance(shading.antialiased, bool):
            raise ValueError("antialiased that is neither true nor false")
        model = Gaussians(tensors, shading, dict(description["metadata"]))
        _require_finite_float32(model)
    return model


def _require_finite_float32(model: Gaussians) -> None:
    for name, tensor in model.parameters.items():
        if tensor.dtype != torch.float32:
            raise ArgumentError(f"{name}: expected torch.float32, got {tensor.dtype}; convert it")
    check.finite(**model.parameters)


def write_ply(path: str | Path, model: Gaussians, told: Told = None) -> Path:
    """Create or replace a binary PLY file in one step, 248 bytes for each Gaussian.

    It holds means, normals of zero, harmonics of degree 3 (those that the model has not are zero), and
    opacities, scales and quaternions raw. Filter and metadata are lost.
    """
    p = {name: x.detach().cpu() for name, x in model.parameters.items()}
    with errors_at(path):
        check.finite(**p)
    sh = pad(p["sh"], (0, 0, 0, HARMONICS - p["sh"].shape[1]))
    return write_columns(path, splat_columns(p, torch.zeros_like(p["means"]), sh), told=told)


def read_ply(path: str | Path) -> Gaussians:
    """Read 3D Gaussians from a PLY file of 3DGS or a compatible program."""
    vertices = read_vertices(path)
    with errors_at(path):
        parameters = {**take_geometry(vertices, 3), "sh": take_harmonics(vertices)}
        check.finite(**parameters)
        return Gaussians(parameters)
