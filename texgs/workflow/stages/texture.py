"""Stage `texture`: give the surfels of a relightable model textures; geometry and material stay."""

from __future__ import annotations

import time
from dataclasses import asdict, dataclass
from pathlib import Path

from texgs.fit.settings import TextureKeys
from texgs.report.results import FitResult
from texgs.workflow.inputs import is_fit_of, model_of, recipe
from texgs.workflow.stage import Outcome, Stage
from texgs.workflow.stages.phase import PHASE, gpu_memory, quality, training_quality
from texgs.workflow.stages.settings import OfTF, Recipe


@dataclass
class Settings(OfTF):
    """What the stage reads of the configuration."""

    fit: Recipe
    texture: TextureKeys


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write model.safetensors.

    It reads `model`, of the stage before, and `views`, the transforms_train.json.
    """
    from texgs.core.check import torch_device
    from texgs.fields.surfels.model_file import read_model, write_model
    from texgs.fit.texels import texturize
    from texgs.volume.images import load
    from texgs.volume.view_set import read_views

    fit, title = settings.fit, f"{settings.dataset}/{settings.tf}: texture"
    device = torch_device(fit.device)
    views, before = read_views(inputs["views"].parent), read_model(inputs["model"]).to(device)
    images = load(views.train, fit.reduce)
    start = time.monotonic()
    model = texturize(before, images, **asdict(settings.texture), seed=fit.seed, title=title)
    seconds = time.monotonic() - start
    write_model(output / "model.safetensors", model)
    result = FitResult(
        seconds,
        len(model),
        sizes=model.sizes(),
        notes={"texels": len(model.parameters["texels"])},
        **quality(model, views, fit.reduce, title),
        **training_quality(model, views, fit.reduce, title),
        peak_gpu_memory_mib=gpu_memory(device),
    )
    return Outcome(result)


STAGE = Stage(
    "texture",
    order=70,
    help="give relightable surfels textures",
    rule=PHASE,
    schema=Settings,
    select=lambda config: {**recipe()(config), "texture": config.fit.texture},
    inputs=model_of("shading"),
    work=work,
    applies=is_fit_of("surfels"),
)
