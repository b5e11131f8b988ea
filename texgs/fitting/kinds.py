"""Specifications of fits for each kind of field: phases, or settings and function of a single phase."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from texgs.core.specifications import import_name, specifications
from texgs.fields import kinds as fields
from texgs.fitting.ray_settings import PaletteKeys, VoxelKeys
from texgs.fitting.settings import GaussianKeys
from texgs.fitting.task import FitTask, Fitted


@dataclass(frozen=True)
class FitSpec:
    """The fit of one kind of field. Its function is named "module:function" and imported late."""

    name: str  # of the kind
    summary: str  # what the fit does, in `texgs --help`
    phases: tuple[str, ...]  # stages in order; the last makes the models of scenes
    settings: type[Any] | None = None  # class of the keys `fit.NAME`; None for surfels, with keys in `fit`
    function: str = ""  # from a task to a result; none for surfels, as each phase is a stage
    check: Callable[[Any], None] = lambda settings: None  # raises if settings contradict each other
    devices: frozenset[str] = frozenset({"cpu", "cuda"})  # kinds of device that fit it

    @property
    def field(self) -> fields.Kind:
        """The kind of field."""
        return fields.kinds()[self.name]

    @property
    def module(self) -> str:
        """The module of the function."""
        return self.function.partition(":")[0]

    def fit(self, task: FitTask[Any]) -> Fitted:
        """Fit a field to views, from the last checkpoint if any."""
        fitted: Fitted = import_name(self.function)(task)
        return fitted


CPU = frozenset({"cpu"})
FITS = (
    FitSpec(
        "gaussians",
        "fit 3D Gaussians, the field of 3DGS",
        ("gaussians",),
        GaussianKeys,
        "texgs.fitting.gaussians:fit_gaussians",
    ),
    FitSpec(
        "palette",
        "fit networks with palette colours",
        ("palette",),
        PaletteKeys,
        "texgs.fitting.palette:fit_palette",
        PaletteKeys.check,
        CPU,
    ),
    FitSpec("surfels", "textured 2D Gaussians", ("surfels", "shading", "texture")),
    FitSpec(
        "voxels",
        "fit a sparse grid of voxels",
        ("voxels",),
        VoxelKeys,
        "texgs.fitting.voxels:fit_voxels",
        VoxelKeys.check,
        CPU,
    ),
)


def fit_specs() -> dict[str, FitSpec]:
    """Return the specification of the fit of each kind of field, by name."""
    found = {**specifications(fields.__name__, "FIT"), **{each.name: each for each in FITS}}
    return dict(sorted(found.items()))
