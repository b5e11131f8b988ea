"""Stage `shading`: from surfels to relightable ones, with Blinn-Phong shading fitted to the views."""

from dataclasses import asdict, dataclass
from pathlib import Path

from texgs.core.device import torch_device
from texgs.fields.harmonics import base_color
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import read_model, write_model
from texgs.fields.surfels.shading import material, raw_material
from texgs.fit import checkpoint
from texgs.fit.settings import Material, Phase
from texgs.report.results import FitResult
from texgs.volume.images import load
from texgs.volume.view_set import read_views
from texgs.workflow.stages.outcome import Outcome
from texgs.workflow.stages.phase import gpu_memory, quality, run_phase
from texgs.workflow.stages.settings import OfTF, Recipe

HARMONICS = ("sh", "sh_rest")


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

    Args:
        settings: of the job.
        inputs: `model`, of the stage before, and `views`, the transforms_train.json.
        output: folder.
    """
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
