"""Stage `figure`: show what a fit is worth, its phases beside views it has not seen."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from texgs.fitting.kinds import fit_specs
from texgs.report.results import Result
from texgs.workflow.inputs import is_fit, view_set
from texgs.workflow.stage import Config, Outcome, Rule, Stage, read, result_file
from texgs.workflow.stages.settings import OfTF, Recipe


@dataclass(frozen=True)
class FigureResult(Result, section="fitting"):
    """A figure of a fit."""

    shown: list[str]  # views
    primitives: int


@dataclass(kw_only=True)
class ShownFit(Recipe):
    """What the figure says of a fit."""

    surfels_iterations: int = read("fit.surfels.iterations")


@dataclass(kw_only=True)
class Settings(OfTF):
    """What the stage reads of the configuration."""

    fit: ShownFit


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write figure.png.

    It reads the models of all phases by their names, and `views`, the transforms_train.json; without test
    views training views are shown. A phase that only seeds is left out.
    """
    from texgs.fields.files import open_field
    from texgs.fields.surfels.model import Surfels
    from texgs.report.fit_figure import shown_views, write_fit_figure
    from texgs.volume.view_set import read_views

    fit, shown = settings.fit, shown_views(read_views(inputs["views"].parent))
    models = {phase: open_field(path) for phase, path in inputs.items() if phase != "views"}
    last = next(reversed(models.values()))
    counts = {last.kind: len(last)}
    if isinstance(last, Surfels):
        counts["texels"] = len(last.parameters["texels"])
    title = f"{settings.dataset}/{settings.tf}, recipe {fit.name}: "
    title += ", ".join(f"{count:,} {things}" for things, count in counts.items())
    if fit.surfels_iterations == 0:
        models.pop("surfels", None)
    write_fit_figure(output / "figure.png", models, shown, fit.reduce, title)
    return Outcome(FigureResult(list(shown), len(last)))


def inputs(config: Config) -> dict[str, Path]:
    """Return the models that the phases of the fit write, and the views."""
    phases = fit_specs()[config.fit.field].phases
    return {**{name: result_file("phase", config, name) for name in phases}, **view_set(config)}


STAGE = Stage(
    "figure",
    order=90,
    help="show a fit beside test views, with its maps",
    rule=Rule(
        "figure",
        "{dataset}/{tf}/{fit}/figure",
        ("figure.png",),
        target="figures",
        shown={"figure.png": "Test views, the phases of the fit, errors, normals, depth and material."},
    ),
    inputs=inputs,
    work=work,
    applies=is_fit,
)
