"""Stage `figure`: show what a fit is worth, its phases beside views it has not seen."""

from pathlib import Path
from typing import Any

from texgs.cli.stages.outcome import Outcome
from texgs.fields.surfels.model_file import read_model
from texgs.report.fit_figure import write_fit_figure
from texgs.report.fitting import PHASES
from texgs.volume.view_set import read_views

SHOWN = "Test views, the phases of the fit, errors, normals, depth and material."


def work(settings: dict[str, Any], inputs: dict[str, Path], output: Path) -> Outcome:
    """Write figure.png.

    Args:
        settings: what the stage reads of the configuration.
        inputs: `surfels`, `shading` and `texture`, the models of these phases, and `views`, the
            transforms_train.json; without test views training views are shown.
        output: folder.
    """
    fit, views = settings["fit"], read_views(inputs["views"].parent)
    split, candidates = ("test", views.test) if views.test else ("training", views.train)
    shown = sorted({0, len(candidates) // 3})
    fitted = [phase for phase in PHASES if phase != "surfels" or fit["surfels_iterations"]]
    models = {phase: read_model(inputs[phase]) for phase in fitted}
    texture = models["texture"]
    counts = {"surfels": len(texture), "texels": len(texture.parameters["texels"])}
    title = f"{settings['dataset']}/{settings['tf']}, recipe {fit['name']}: "
    title += ", ".join(f"{count:,} {things}" for things, count in counts.items())
    write_fit_figure(
        output / "figure.png",
        models,
        {f"{split} view {index}": candidates[index] for index in shown},
        fit["reduce"],
        title,
    )
    return Outcome({"shown": shown, **counts}, {"figure.png": SHOWN})
