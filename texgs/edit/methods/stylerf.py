"""StyleRF-VolVis (Tang et al. 2024), one of the paper's baselines: styles of pictures for palette fields."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.edit.methods import style
from texgs.edit.methods.style import FeatureKeys

if TYPE_CHECKING:
    from texgs.edit.recipe import Recipe
    from texgs.edit.task import EditedScene, Task
    from texgs.fields.palette.model import PaletteField
    from texgs.volume.view_set import View

STYLES = "edit.stylerf.styles"


@dataclass(frozen=True)
class StyleRfKeys(FeatureKeys):
    """How palette colours take on styles."""

    styles: list[str] = key(
        [], "a picture for each palette colour of the fit, whatever looks say; default: `style` for all"
    )
    epochs: float = key(5.0, "rounds through the training views, for the style", least=0)
    distillation: int = key(500, "steps before, in which free colours learn the recoloured palette", least=0)
    rate: float = key(1e-2, "of Adam", above=0)
    variation: float = key(1.0, "weight of total variation of the image", least=0)


def run(task: Task[StyleRfKeys]) -> EditedScene:
    """Give the models the styles; write style.png."""
    from texgs.edit.palette_style import stylize_palette
    from texgs.volume.images import load

    keys, look = task.settings, style.Look.of(task)
    errors = {}
    pictures = [style.picture_of(name, STYLES) for name in keys.styles]

    def one(name: str, model: PaletteField, views: Sequence[View]) -> PaletteField:
        recipe = recipe_of(keys, len(views), task.edit.seed)
        chosen = pictures or [look.picture(name)] * len(model.colors)
        look.pictures.update({f"{name}-{index + 1}": each for index, each in enumerate(pictures)})
        edited, look.losses[name], errors[name] = stylize_palette(
            *(model, load(views, task.reduce), chosen, recipe, keys, look.vgg), title=look.title(name)
        )
        return edited

    scene = task.each_model(one)  # type: ignore[arg-type]
    result = look.result(scene)
    return replace(result, notes={"distillation_rmse": errors})


def recipe_of(settings: StyleRfKeys, views: int, seed: int = 0) -> Recipe:
    """Its losses for a number of views: features see half of the resolution, and the style too."""
    recipe = settings.recipe(round(settings.epochs * views), seed, reduce=2)
    return replace(recipe, rate=settings.rate)


def check(settings: StyleRfKeys) -> None:
    """Require pictures that are there."""
    from texgs.edit.pictures import PICTURES

    LOOK.check(settings)
    for name in settings.styles:
        if name not in PICTURES:
            style.picture_of(name, STYLES)


def check_fit(settings: StyleRfKeys, fit: Any) -> None:
    """Require a style for each palette colour of a fit."""
    if settings.styles and len(settings.styles) != fit.palette.colors:
        raise ArgumentError(
            f"{STYLES}: expected one for each of {fit.palette.colors} palette colours of "
            f"fit={fit.name}, got {len(settings.styles)}; or name one `style` for all"
        )


def files(settings: StyleRfKeys) -> dict[str, Path]:
    """Pictures that are files."""
    several = {f"style{i}": Path(name) for i, name in enumerate(settings.styles) if Path(name).is_file()}
    return {**style.files(settings), **several}


LOOK = style.look_method(
    "stylerf",
    "give a scene of palette fields the styles of pictures, as StyleRF-VolVis does",
    StyleRfKeys,
    run,
    "palette",
)
METHOD = replace(
    LOOK,
    check=check,
    check_fit=check_fit,
    files=files,
    style=lambda settings: None if settings.styles else style.style_of(settings, "edit.stylerf"),
    followed=lambda settings: ", ".join(Path(name).name for name in settings.styles or [settings.style]),
)
