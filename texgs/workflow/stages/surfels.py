"""Stage `surfels`: seed surfels in the views, and fit them with spherical harmonics."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.fit.settings import Phase, Seeds
from texgs.report.results import FitResult
from texgs.workflow.inputs import is_fit_of, prepared_volume, recipe, view_set
from texgs.workflow.stage import Outcome, Stage
from texgs.workflow.stages.phase import PHASE, gpu_memory, quality, run_phase
from texgs.workflow.stages.settings import OfTF, Recipe

if TYPE_CHECKING:
    from texgs.config.schema import Config

LATER = ("materials", "first_material", "shading", "texture")  # keys of a recipe that later stages read


@dataclass
class SurfelsRecipe(Recipe):
    """What this phase reads of a recipe besides."""

    low_pass: float
    facing: bool
    material_range: str
    seeds: Seeds


@dataclass
class Settings(OfTF):
    """What the stage reads of the configuration."""

    fit: SurfelsRecipe
    phase: Phase


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write model.safetensors; a recipe without iterations here only seeds.

    It reads `views`, the transforms_train.json; for seeds in voxels also `volume`, the volume.nrrd.
    """
    import torch

    from texgs.core.check import torch_device
    from texgs.fields.harmonics import join, split, zeroth
    from texgs.fields.surfels.model import Surfels
    from texgs.fields.surfels.model_file import write_model
    from texgs.fields.surfels.shading import ShadingModel
    from texgs.fit import checkpoint
    from texgs.fit.seeds import seed_surfels
    from texgs.volume.images import load
    from texgs.volume.nrrd_file import open_grid
    from texgs.volume.view_set import read_views

    fit, phase = settings.fit, settings.phase
    title = f"{settings.dataset}/{settings.tf}: surfels"
    views = read_views(inputs["views"].parent)
    images = load(views.train, fit.reduce)
    rendered = views.metadata.get("shading") or {}
    local_viewer = bool(rendered.get("local_viewer", True))
    shading = ShadingModel(fit.low_pass, fit.material_range, local_viewer, fit.facing)  # type: ignore[arg-type]
    volume = open_grid(inputs["volume"]) if "volume" in inputs else None
    parameters, colors = seed_surfels(images, views, **asdict(fit.seeds), seed=fit.seed, volume=volume)
    sh = zeroth(colors)
    if phase.iterations:
        sh = torch.cat([sh, torch.zeros(len(sh), (phase.sh_degree + 1) ** 2 - 1, 3)], dim=1)
    device = torch_device(fit.device)
    start = {name: x.to(device) for name, x in {**parameters, **split(sh)}.items()}
    model, seconds, losses = run_phase(start, shading, images, phase, fit.seed, output, title)
    model = Surfels(join(model.parameters), shading, {"dataset": settings.dataset, "tf": settings.tf})
    write_model(output / "model.safetensors", model)
    measured = quality(model, views, fit.reduce, title) if phase.iterations else {}
    checkpoint.discard(output / checkpoint.FOLDER)
    return Outcome(
        FitResult(
            seconds, len(model), phase.iterations, losses, peak_gpu_memory_mib=gpu_memory(device), **measured
        )
    )


def select(config: Config) -> dict[str, Any]:
    """Return what the stage reads."""
    shared = recipe("low_pass", "facing", "material_range", "seeds", later=LATER)(config)
    return {**shared, "phase": config.fit.surfels}


def inputs(config: Config) -> dict[str, Path]:
    """Return the views, and the volume where surfels start in its voxels."""
    from_voxels = config.fit.seeds.kind == "voxels" and config.dataset.views_folder is None
    return {**view_set(config), **(prepared_volume(config) if from_voxels else {})}


STAGE = Stage(
    "surfels",
    order=50,
    help="seed surfels and fit them with spherical harmonics",
    rule=PHASE,
    schema=Settings,
    select=select,
    inputs=inputs,
    work=work,
    applies=is_fit_of("surfels"),
)
