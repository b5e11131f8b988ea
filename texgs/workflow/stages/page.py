"""Stage `page`: a scene as one HTML file that shows and edits it in a browser, without a server."""

from dataclasses import dataclass
from pathlib import Path

from texgs.core.io import write_bytes
from texgs.core.memory import MIB
from texgs.core.names import PAGE
from texgs.edit.method import NO_METHOD, methods
from texgs.fields.kinds import kinds
from texgs.report.results import PageResult
from texgs.workflow.inputs import fitted_scene, is_fit, is_swept, models_of_scene
from texgs.workflow.stage import Config, Outcome, Rule, Stage, read, result_file
from texgs.workflow.stages.settings import FitLabel, OfDataset

SHOWN = "The scene: open it to turn it, to move its light, and to change colours and opacities."


@dataclass(kw_only=True)
class Settings(OfDataset):
    """What the stage reads of the configuration."""

    fit: FitLabel
    look: str = read("edit.name")  # or "none"
    look_seed: int = read("edit.seed")


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write scene.html and poster.jpg.

    It reads `scene`, the scene.yaml.
    """
    from texgs.scene.scene_file import read_scene
    from texgs.viewer.standalone import write_page

    scene = read_scene(inputs["scene"])
    parts = [settings.dataset, settings.fit.name, *([settings.look] if settings.look != NO_METHOD else [])]
    file = output / PAGE
    page = write_page(file, scene, " ".join(parts))
    write_bytes(output / "poster.jpg", page.poster)
    result = PageResult(settings.look, page.surfels, file.stat().st_size / MIB)
    words = "The scene without edits." if settings.look == NO_METHOD else "The edited scene."
    return Outcome(result, {"poster.jpg": words})


def inputs(config: Config) -> dict[str, Path]:
    """Return the scene of an edit, or the one as fitted, with its models."""
    scene = fitted_scene(config) if is_fit(config) else result_file("edit", config)
    return {"scene": scene, **models_of_scene(config)}


def applies(config: Config) -> bool:
    """Return whether the scene or its new look becomes a page: of sweeps only the numbers are of interest."""
    is_shown = is_fit(config) or methods()[config.edit.method].is_look
    able = "html" in kinds()[config.fit.field].exports
    return bool(config.page.made and config.tf is None and able and is_shown and not is_swept(config))


STAGE = Stage(
    "page",
    order=160,
    help="make a page of a scene that shows and edits it in a browser",
    rule=Rule(
        "page",
        "{dataset}/scene/{fit}/pages/{edit}",
        (PAGE, "poster.jpg"),
        target="scenes",
        threads=2,
        shown={PAGE: SHOWN},
    ),
    inputs=inputs,
    work=work,
    applies=applies,
)
