"""Stage `comparison`: show the fits of several recipes side by side."""

from dataclasses import dataclass
from pathlib import Path

from texgs.report.results import ComparisonResult
from texgs.workflow.inputs import is_first_recipe, is_fit, is_swept, last_phase, view_set, with_recipe
from texgs.workflow.stage import Config, Outcome, Rule, Stage, read, result_file
from texgs.workflow.stages.settings import OfTF


@dataclass(kw_only=True)
class Settings(OfTF):
    """What the stage reads of the configuration."""

    reduce: int = read("fit.reduce")  # of images


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write comparison.png.

    It reads the models of the last phases by the names of the recipes, and `views`, the
    transforms_train.json; without test views training views are shown.
    """
    from texgs.fields.files import open_field
    from texgs.report.fit_figure import shown_views, write_comparison
    from texgs.volume.view_set import read_views

    shown = shown_views(read_views(inputs["views"].parent))
    models = {recipe: open_field(path) for recipe, path in inputs.items() if recipe != "views"}
    title = f"{settings.dataset}/{settings.tf}, {len(models)} recipes"
    write_comparison(output / "comparison.png", models, shown, settings.reduce, title)
    return Outcome(ComparisonResult(list(models), list(shown)))


def inputs(config: Config) -> dict[str, Path]:
    """Return the last models of all recipes of the experiment, by recipe, and the views."""
    fits = [with_recipe(config, name) for name in config.fits]
    models = {each.fit.name: result_file("phase", each, last_phase(each)) for each in fits}
    return {**models, **view_set(config)}


def applies(config: Config) -> bool:
    """Return whether this is the first of several recipes: its configuration stands for all of them."""
    return is_fit(config) and len(config.fits) > 1 and not is_swept(config) and is_first_recipe(config)


STAGE = Stage(
    "comparison",
    order=100,
    help="show the fits of several recipes side by side in test views",
    rule=Rule(
        "comparison",
        "{dataset}/{tf}/comparison/{gallery}",
        ("comparison.png",),
        target="comparisons",
        shown={"comparison.png": "Test views, the fit of each recipe with its PSNR, and below it its error."},
    ),
    inputs=inputs,
    work=work,
    applies=applies,
)
