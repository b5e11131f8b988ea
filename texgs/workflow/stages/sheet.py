"""Stage `sheet`: read a folder of views, rendered here or elsewhere, and show them on one contact sheet."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from texgs.config.compose import ONE_LIGHT
from texgs.report.results import SheetResult
from texgs.workflow.inputs import is_first_recipe, is_fit, view_set
from texgs.workflow.stage import Config, Outcome, Rule, Stage
from texgs.workflow.stages.settings import OfTF

if TYPE_CHECKING:
    from PIL.Image import Image

SHOWN = 12  # views


def work(settings: OfTF, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write sheet.png from up to twelve training views.

    It reads `views`, the transforms_train.json of the folder of views.
    """
    from PIL.Image import fromarray

    from texgs.volume.cameras import spread
    from texgs.volume.contact_sheet import write_contact_sheet
    from texgs.volume.view_set import read_views

    views = read_views(inputs["views"].parent)
    pictures = [fromarray(view.load().numpy()) for view in spread(views.train, SHOWN)]
    write_contact_sheet(output / "sheet.png", [picture.crop(common_box(pictures)) for picture in pictures])
    camera = views.train[0].camera
    return Outcome(SheetResult(len(views.train), len(views.test), camera.width, camera.height))


def common_box(pictures: list[Image]) -> tuple[int, int, int, int]:
    """Return left, top, right and bottom of what shows in any picture; the whole where nothing does."""
    boxes = [box for picture in pictures if (box := picture.getchannel("A").getbbox())]
    if not boxes:
        return 0, 0, *pictures[0].size
    lefts, tops, rights, bottoms = zip(*boxes, strict=True)
    return min(lefts), min(tops), max(rights), max(bottoms)


def applies(config: Config) -> bool:
    """Return whether these are the views of the first recipe, and of no sweep."""
    is_own = config.views.name.removesuffix(ONE_LIGHT) == "views"
    return is_fit(config) and is_own and is_first_recipe(config)


STAGE = Stage(
    "sheet",
    order=40,
    help="show views on one contact sheet",
    rule=Rule(
        "sheet",
        "{dataset}/{tf}/sheet",
        ("sheet.png",),
        target="sheets",
        threads=1,
        shown={"sheet.png": "Views that the model was fitted to, and test views."},
    ),
    inputs=view_set,
    work=work,
    applies=applies,
)
