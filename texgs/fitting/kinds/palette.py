"""The fit of a palette field to random rays of views."""

from texgs.fields.kinds.palette import FIELD
from texgs.fitting.kinds import FitSpec, FitTask, Fitted
from texgs.fitting.ray_settings import PaletteKeys


def fit(task: FitTask[PaletteKeys]) -> Fitted:
    """Fit networks to random rays, from the last checkpoint if there is one."""
    from texgs.fitting.checkpoint import FOLDER, run_to_end
    from texgs.fitting.palette import PaletteFit

    run = PaletteFit(task.images, task.settings, task.seed)
    seconds = run_to_end(run, task.output / FOLDER, task.title)
    field = run.field(task.metadata)
    return Fitted(field, seconds, run.iterations, run.losses, {"palette": field.colors.tolist()})


FIT = FitSpec(
    FIELD,
    "fit networks with palette colours",
    phases=("palette",),
    settings=PaletteKeys,
    fit=fit,
    check=PaletteKeys.check,
    devices=frozenset({"cpu"}),
)
