"""Stage `comparison`: show the fits of several recipes side by side."""

from dataclasses import dataclass
from pathlib import Path

from texgs.fields.files import open_field
from texgs.report.comparison import write_comparison
from texgs.report.results import ComparisonResult
from texgs.volume.view_set import read_views
from texgs.workflow.stages.figure import shown_views
from texgs.workflow.stages.outcome import Outcome
from texgs.workflow.stages.settings import OfTF

SHOWN = "Test views, the fit of each recipe with its PSNR, and below it its error."


@dataclass
class Settings(OfTF):
    """What the stage reads of the configuration."""

    reduce: int  # of images


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write comparison.png.

    Args:
        settings: of the job.
        inputs: the models of the last phases by the names of the recipes, and `views`, the
            transforms_train.json; without test views training views are shown.
        output: folder.
    """
    shown = shown_views(read_views(inputs["views"].parent))
    models = {recipe: open_field(path) for recipe, path in inputs.items() if recipe != "views"}
    write_comparison(
        output / "comparison.png",
        models,
        shown,
        settings.reduce,
        f"{settings.dataset}/{settings.tf}, {len(models)} recipes",
    )
    return Outcome(ComparisonResult(list(models), list(shown)), {"comparison.png": SHOWN})
