"""The fit of 3D Gaussians: one phase of the loop that surfels are fitted by."""

from dataclasses import asdict, dataclass

from texgs.core.keys import key
from texgs.fields.kinds.gaussians import FIELD
from texgs.fitting.kinds import FitSpec, FitTask, Fitted
from texgs.fitting.settings import CommonRates, Densify, Losses, Phase, Rates, Seeds


@dataclass(frozen=True)
class GaussianKeys:
    """Keys of a fit of 3D Gaussians."""

    iterations: int = key(30000, "iterations, each of one view", least=0)
    sh_degree: int = key(3, "degree of the spherical harmonics", least=0, most=3)
    sh_every: int = key(1000, "iterations between degrees", least=1)
    antialiased: bool = key(False, "thin Gaussians keep their weight in images of every size")
    dssim: float = key(0.2, "lambda: weight of D-SSIM against L1", least=0)
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


def fit(task: FitTask[GaussianKeys]) -> Fitted:
    """Fit Gaussians to the views, from the last checkpoint if there is one."""
    from texgs.fields.gaussians.model import Baked, Gaussians
    from texgs.fields.splats import join
    from texgs.fitting.checkpoint import FOLDER, run_to_end
    from texgs.fitting.loop import Fit
    from texgs.fitting.seeds import seed_gaussians

    keys = task.settings
    most = keys.densify.cap
    start = seed_gaussians(task.images, task.views, keys.seeds, keys.sh_degree, task.seed, task.volume, most)
    shading = Baked(keys.antialiased)
    on_device = {name: x.to(task.device) for name, x in start.items()}
    run = Fit(on_device, shading, task.images, keys.phase, task.seed)
    seconds = run_to_end(run, task.output / FOLDER, task.title)
    parameters = join({name: x.detach() for name, x in run.parameters.items()})
    return Fitted(Gaussians(parameters, shading, task.metadata), seconds, keys.iterations, run.losses)


FIT = FitSpec(
    FIELD,
    "fit 3D Gaussians, the field of 3DGS",
    phases=("gaussians",),
    settings=GaussianKeys,
    fit=fit,
)
