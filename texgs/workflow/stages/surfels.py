"""Stage `surfels`: seed surfels in the views, and fit them with spherical harmonics."""

from dataclasses import dataclass
from pathlib import Path

from texgs.fitting.settings import Phase, Seeds
from texgs.workflow.inputs import is_changed, is_fit_of, start_of_fit
from texgs.workflow.stage import Outcome, Stage, read
from texgs.workflow.stages.phase import PHASE, FitJob, PhaseSettings
from texgs.workflow.stages.settings import Recipe

# Keys of a recipe that later stages read.
LATER = ("normals", "materials", "attributes", "hold", "first_material", "shading", "texture")


@dataclass(kw_only=True)
class SurfelsRecipe(Recipe):
    """What this phase reads of a recipe besides."""

    low_pass: float = read("fit.low_pass")
    facing: bool = read("fit.facing")
    material_range: str = read("fit.material_range")
    seeds: Seeds = read("fit.seeds")
    cap: int | None = read("fit.shading.densify.cap")  # surfels that the next phase keeps
    changed: bool = read(lambda config: is_changed(config.fit, LATER))


@dataclass(kw_only=True)
class Settings(PhaseSettings):
    """What the stage reads of the configuration."""

    fit: SurfelsRecipe
    phase: Phase = read("fit.surfels")


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write model.safetensors; a recipe without iterations here only seeds.

    It reads `views`, the transforms_train.json; where seeds come from it also `volume`, the volume.nrrd.
    """
    import torch

    from texgs.fields.splats import join, split, zeroth
    from texgs.fields.surfels.model import Surfels
    from texgs.fields.surfels.model_file import write_model
    from texgs.fields.surfels.shading import ShadingModel
    from texgs.fitting.seeds import seed_surfels

    fit, phase, job = settings.fit, settings.phase, FitJob.of(settings, inputs, output)
    rendered = job.views.metadata.get("shading") or {}
    local_viewer = bool(rendered.get("local_viewer", True))
    shading = ShadingModel(fit.low_pass, fit.material_range, local_viewer, fit.facing)  # type: ignore[arg-type]
    most = phase.densify.cap if phase.iterations else fit.cap
    parameters, colors = seed_surfels(job.images, job.views, fit.seeds, fit.seed, job.volume, most)
    sh = zeroth(colors)
    if phase.iterations:
        sh = torch.cat([sh, torch.zeros(len(sh), (phase.sh_degree + 1) ** 2 - 1, 3)], dim=1)
    start = {name: x.to(job.device) for name, x in {**parameters, **split(sh)}.items()}
    model, seconds, losses = job.run(start, shading, phase)
    model = Surfels(join(model.parameters), shading, job.metadata)
    write_model(output / "model.safetensors", model)
    return job.outcome(model, seconds, phase.iterations, losses, ("test",) if phase.iterations else ())


STAGE = Stage(
    "surfels",
    order=50,
    help="seed surfels and fit them with spherical harmonics",
    rule=PHASE,
    inputs=start_of_fit,
    work=work,
    applies=is_fit_of("surfels"),
)
