"""Stage `texture`: give the surfels of a relightable model textures; geometry and material stay."""

import time
from dataclasses import dataclass
from pathlib import Path

from texgs.fitting.settings import TextureKeys
from texgs.workflow.inputs import is_fit_of, model_of
from texgs.workflow.stage import Outcome, Stage, read
from texgs.workflow.stages.phase import PHASE, FitJob, PhaseSettings


@dataclass(kw_only=True)
class Settings(PhaseSettings):
    """What the stage reads of the configuration."""

    texture: TextureKeys = read("fit.texture")


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write model.safetensors.

    It reads `model`, of the stage before, and `views`, the transforms_train.json.
    """
    from texgs.fields.surfels.model_file import read_model, write_model
    from texgs.fitting.texels import texturize

    job = FitJob.of(settings, inputs, output)
    before = read_model(inputs["model"]).to(job.device)
    start = time.monotonic()
    model = texturize(before, job.images, settings.texture, settings.fit.seed, job.title)
    seconds = time.monotonic() - start
    write_model(output / "model.safetensors", model)
    notes = {"texels": len(model.parameters["texels"])}
    return job.outcome(model, seconds, measured=("test", "train", "relit"), sizes=model.sizes(), notes=notes)


STAGE = Stage(
    "texture",
    order=70,
    help="give relightable surfels textures",
    rule=PHASE,
    inputs=model_of("shading"),
    work=work,
    applies=is_fit_of("surfels"),
)
