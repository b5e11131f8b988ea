"""3D Gaussians with spherical harmonics (Kerbl et al. 2023, 3DGS): what several methods of editing build on.

Lighting is baked into their colours, so that edits can change their opacity but not their light or palette.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.config.fields import Kind
from texgs.config.phase import CommonRates, Densify, Losses, Phase, Rates, Seeds
from texgs.core.errors import ArgumentError
from texgs.core.keys import key

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.fields.gaussians.composition import JoinedGaussians
    from texgs.fields.gaussians.model import Gaussians
    from texgs.fit.task import FitTask, Fitted


@dataclass
class GaussianKeys:
    """A fit of 3D Gaussians."""

    iterations: int = key(30000, "views, one each", least=0)
    sh_degree: int = key(3, "of spherical harmonics", least=0, most=3)
    sh_every: int = key(1000, "iterations between degrees", least=1)
    antialiased: bool = key(False, "thin Gaussians keep their weight in images of every size")
    dssim: float = key(0.2, "lambda of D-SSIM against L1", least=0)
    alpha: float = key(0.0, "weight of L1 + D-SSIM of alpha", least=0)
    rates: CommonRates = key(CommonRates, "learning rates")
    densify: Densify = key(Densify, "density control")
    seeds: Seeds = key(Seeds, "where Gaussians start")

    @property
    def phase(self) -> Phase:
        """The run of the loop."""
        return Phase(
            self.iterations,
            self.sh_degree,
            self.sh_every,
            rates=Rates(**asdict(self.rates)),
            losses=Losses(self.dssim, self.alpha),
            densify=self.densify,
        )


def read(path: Path) -> Gaussians:
    """The Gaussians in a file of ours, or in a PLY file of 3DGS."""
    from texgs.core.ply_file import is_ply
    from texgs.fields.gaussians.model_file import read_gaussians
    from texgs.fields.gaussians.ply import read_ply

    return read_ply(path) if is_ply(path) else read_gaussians(path)


def write(path: Path, field: Gaussians) -> Path:
    """Write Gaussians without loss."""
    from texgs.fields.gaussians.model_file import write_gaussians

    return write_gaussians(path, field)


def compose(fields: Sequence[Gaussians], segments: Sequence[Sequence[Tensor]]) -> JoinedGaussians:
    """Gaussians as one scene: joined, so that they are sorted and blended together."""
    from texgs.fields.gaussians.composition import JoinedGaussians

    return JoinedGaussians(fields, segments)


def fit(task: FitTask[GaussianKeys]) -> Fitted:
    """Fit Gaussians to the views, from the last checkpoint if there is one."""
    from texgs.fields.gaussians.model import Baked, Gaussians
    from texgs.fields.harmonics import join
    from texgs.fit import checkpoint
    from texgs.fit.gaussian_seeds import seed_gaussians
    from texgs.fit.loop import Fit
    from texgs.fit.resumable import run_to_end
    from texgs.fit.task import Fitted

    keys = task.settings
    start = seed_gaussians(task.images, task.views, keys.seeds, keys.sh_degree, task.seed)
    shading = Baked(keys.antialiased)
    on_device = {name: x.to(task.device) for name, x in start.items()}
    run = Fit(on_device, shading, task.images, keys.phase, task.seed)
    seconds = run_to_end(run, task.output / checkpoint.FOLDER, task.title)
    parameters = join({name: x.detach() for name, x in run.parameters.items()})
    return Fitted(Gaussians(parameters, shading, task.metadata), seconds, keys.iterations, run.losses)


def check(settings: GaussianKeys) -> None:
    """Require a start that Gaussians can have.

    Raises:
        ArgumentError: for voxels of a volume, at which surfels alone start.
    """
    if settings.seeds.kind == "voxels":
        raise ArgumentError(
            "fit.gaussians.seeds.kind: expected no voxels, which are for surfels alone; choose visible"
        )


FIELD: Kind[GaussianKeys] = Kind(
    "gaussians",
    "fit 3D Gaussians, the field of 3DGS",
    ("texgs-gaussians", "ply scale_2"),
    frozenset({"opacity"}),
    read,
    write,
    compose,
    phases=("gaussians",),
    settings=GaussianKeys,
    fit=fit,
    check=check,
    exports=("3dgs", "mesh"),
    depth="depth",  # the mean, as the authors of 2DGS take it of 3D Gaussians
)
