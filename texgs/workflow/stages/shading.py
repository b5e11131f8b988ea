"""Stage `shading`: from surfels to relightable ones, with Blinn-Phong shading fitted to the views."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.fit.settings import Material, Phase
from texgs.report.results import FitResult
from texgs.workflow.inputs import is_fit_of, model_of, recipe
from texgs.workflow.stage import Outcome, Stage
from texgs.workflow.stages.phase import PHASE, gpu_memory, quality, run_phase
from texgs.workflow.stages.settings import OfTF, Recipe

if TYPE_CHECKING:
    from texgs.config.schema import Config

HARMONICS = ("sh", "sh_rest")
LATER = ("texture",)  # keys of a recipe that later stages read


@dataclass
class ShadingRecipe(Recipe):
    """What this phase reads of a recipe besides."""

    material_range: str
    materials: str
    first_material: Material


@dataclass
class Settings(OfTF):
    """What the stage reads of the configuration."""

    fit: ShadingRecipe
    phase: Phase


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write model.safetensors.

    It reads `model`, of the stage before, and `views`, the transforms_train.json.
    """
    from texgs.core.check import torch_device
    from texgs.fields.harmonics import base_color
    from texgs.fields.surfels.model import Surfels
    from texgs.fields.surfels.model_file import read_model, write_model
    from texgs.fields.surfels.shading import material, raw_material
    from texgs.fit import checkpoint
    from texgs.volume.images import load
    from texgs.volume.view_set import read_views

    fit, phase = settings.fit, settings.phase
    title = f"{settings.dataset}/{settings.tf}: shading"
    device = torch_device(fit.device)
    views, before = read_views(inputs["views"].parent), read_model(inputs["model"]).to(device)
    images = load(views.train, fit.reduce)
    start = {name: x for name, x in before.parameters.items() if name not in HARMONICS}
    start["colors"] = base_color(before.parameters["sh"])
    first = raw_material(**asdict(fit.first_material), kind=fit.material_range)
    rows = 1 if fit.materials == "shared" else len(before)
    start |= {name: value.to(device).repeat(rows) for name, value in first.items()}
    model, seconds, losses = run_phase(start, before.shading, images, phase, fit.seed, output, title)
    model = Surfels(model.parameters, before.shading, before.metadata)
    write_model(output / "model.safetensors", model)
    factors = material(model.parameters, before.shading.material)
    result = FitResult(
        seconds,
        len(model),
        phase.iterations,
        losses,
        material={name: float(value.median()) for name, value in factors.items()},
        **quality(model, views, fit.reduce, title),
        peak_gpu_memory_mib=gpu_memory(device),
    )
    checkpoint.discard(output / checkpoint.FOLDER)
    return Outcome(result)


def select(config: Config) -> dict[str, Any]:
    """Return what the stage reads."""
    shared = recipe("material_range", "materials", "first_material", later=LATER)(config)
    return {**shared, "phase": config.fit.shading}


STAGE = Stage(
    "shading",
    order=60,
    help="fit relightable surfels with Blinn-Phong shading",
    rule=PHASE,
    schema=Settings,
    select=select,
    inputs=model_of("surfels"),
    work=work,
    applies=is_fit_of("surfels"),
)
