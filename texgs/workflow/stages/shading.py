"""Stage `shading`: from surfels to relightable ones, with Blinn-Phong shading fitted to the views."""

from dataclasses import asdict, dataclass
from pathlib import Path

from texgs.fitting.settings import Material, Phase
from texgs.workflow.inputs import is_changed, is_fit_of, model_of
from texgs.workflow.stage import Outcome, Stage, read
from texgs.workflow.stages.fit import PHASE, FitJob, PhaseSettings
from texgs.workflow.stages.settings import Recipe

HARMONICS = ("sh", "sh_rest")
LATER = ("texture",)  # keys of a recipe that later stages read


@dataclass(kw_only=True)
class ShadingRecipe(Recipe):
    """What this phase reads of a recipe besides."""

    material_range: str = read("fit.material_range")
    materials: str = read("fit.materials")
    normals: str = read("fit.normals")
    first_material: Material = read("fit.first_material")
    changed: bool = read(lambda config: is_changed(config.fit, LATER))


@dataclass(kw_only=True)
class Settings(PhaseSettings):
    """What the stage reads of the configuration."""

    fit: ShadingRecipe
    phase: Phase = read("fit.shading")


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write model.safetensors.

    It reads `model`, of the stage before, and `views`, the transforms_train.json.
    """
    from texgs.fields.splats import base_color
    from texgs.fields.surfels.model import Surfels
    from texgs.fields.surfels.model_file import read_model, write_model
    from texgs.fields.surfels.shading import in_full_light, material, raw_material

    fit, phase, job = settings.fit, settings.phase, FitJob.of(settings, inputs, output)
    before = read_model(inputs["model"]).to(job.device)
    start = {name: x for name, x in before.parameters.items() if name not in HARMONICS}
    start["colors"] = base_color(before.parameters["sh"])
    if fit.normals == "own" and phase.turns_normals:
        start["normals"] = start["quats"].clone()
    first = raw_material(**asdict(fit.first_material), kind=fit.material_range)
    rows = 1 if fit.materials == "shared" else len(before)
    start |= {name: value.to(job.device).repeat(rows) for name, value in first.items()}
    model, seconds, losses = job.run(start, before.shading, phase)
    lit = in_full_light(model.parameters, before.shading.material)
    model = Surfels(lit, before.shading, before.metadata)
    write_model(output / "model.safetensors", model)
    factors = material(model.parameters, before.shading.material)
    medians = {name: float(value.median()) for name, value in factors.items()}
    return job.outcome(model, seconds, phase.iterations, losses, material=medians)


STAGE = Stage(
    "shading",
    order=60,
    help="fit relightable surfels with Blinn-Phong shading",
    rule=PHASE,
    inputs=model_of("surfels"),
    work=work,
    applies=is_fit_of("surfels"),
)
