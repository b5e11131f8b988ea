"""Stage `shading`: from surfels to relightable ones, with Blinn-Phong shading fitted to the views."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.fitting.settings import Material, Phase
from texgs.workflow.inputs import is_changed, is_fit_of, start_of_shading
from texgs.workflow.stage import Outcome, Stage, read
from texgs.workflow.stages.phase import PHASE, FitJob, PhaseSettings
from texgs.workflow.stages.settings import Recipe

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.fields.surfels.model import Surfels
    from texgs.fitting.attributes import Attributes

HARMONICS = ("sh", "sh_rest")
LATER = ("texture",)  # keys of a recipe that later stages read


@dataclass(kw_only=True)
class ShadingRecipe(Recipe):
    """What this phase reads of a recipe besides."""

    material_range: str = read("fit.material_range")
    materials: str = read("fit.materials")
    normals: str = read("fit.normals")
    hold: float | None = read("fit.hold")
    first_material: Material = read("fit.first_material")
    changed: bool = read(lambda config: is_changed(config.fit, LATER))


@dataclass(kw_only=True)
class Settings(PhaseSettings):
    """What the stage reads of the configuration."""

    fit: ShadingRecipe
    phase: Phase = read("fit.shading")


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write model.safetensors.

    It reads `model`, of the stage before, and `views`, the transforms_train.json; where attributes come from
    it also `volume`, the volume.nrrd.
    """
    from texgs.fields.surfels.model import Surfels
    from texgs.fields.surfels.model_file import read_model, write_model
    from texgs.fields.surfels.shading import in_full_light, material

    fit, phase, job = settings.fit, settings.phase, FitJob.of(settings, inputs, output)
    before = read_model(inputs["model"]).to(job.device)
    start, held, notes = start_of(before, fit, job, phase.turns_normals)
    model, seconds, losses = job.run(start, before.shading, phase, held)
    lit = in_full_light(model.parameters, before.shading.material)
    model = Surfels(lit, before.shading, before.metadata)
    write_model(output / "model.safetensors", model)
    factors = material(model.parameters, before.shading.material)
    medians = {name: float(value.median()) for name, value in factors.items()}
    return job.outcome(model, seconds, phase.iterations, losses, material=medians, notes=notes)


def start_of(
    before: Surfels, fit: ShadingRecipe, job: FitJob, turns_normals: bool
) -> tuple[dict[str, Tensor], Attributes | None, dict[str, float]]:
    """Return parameters that the phase starts with, the attributes that hold them, and what to tell of these.

    Colours, normals and material are those of the volume where there is one.
    """
    from texgs.fields.splats import base_color
    from texgs.fields.surfels.shading import raw_material
    from texgs.fitting.attributes import Attributes
    from texgs.fitting.seeds import shown_volume

    start = {name: x for name, x in before.parameters.items() if name not in HARMONICS}
    start |= {"colors": base_color(before.parameters["sh"]), "normals": start["quats"].clone()}
    material = raw_material(**asdict(fit.first_material), kind=fit.material_range)
    start |= material
    held, notes = None, {}
    if job.volume is not None:
        volume = Attributes.of(*shown_volume(job.volume, job.views, job.device), start["means"], fit.hold)
        start |= volume.start(start["means"], fit.material_range)
        held, notes = volume.held, {"coherence": volume.coherence, "hold": volume.hold}
    if fit.normals == "surfel" or not turns_normals:
        del start["normals"]
    rows = 1 if fit.materials == "shared" else len(before)
    start |= {name: start[name].to(job.device).repeat(rows) for name in material}
    return start, held, notes


STAGE = Stage(
    "shading",
    order=60,
    help="fit relightable surfels with Blinn-Phong shading",
    rule=PHASE,
    inputs=start_of_shading,
    work=work,
    applies=is_fit_of("surfels"),
)
