"""StyleSplat (Jain et al. 2024), one of the paper's baselines: the style of a picture for 3D Gaussians."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from texgs.core.keys import key
from texgs.edit.methods import style
from texgs.edit.methods.style import FeatureKeys

if TYPE_CHECKING:
    from texgs.edit.recipe import Recipe
    from texgs.edit.task import EditedScene, Task
    from texgs.fields.gaussians.model import Gaussians
    from texgs.volume.view_set import View


@dataclass(frozen=True)
class StyleSplatKeys(FeatureKeys):
    """How colours of 3D Gaussians take on a style."""

    iterations: int = key(2000, "views, one each", least=0)
    rate: float = key(0.005, "of zeroth harmonics; the others have a twentieth", above=0)


def run(task: Task[StyleSplatKeys]) -> EditedScene:
    """Give the models the style; write style.png."""
    from texgs.edit.gaussian_style import stylize_gaussians
    from texgs.volume.images import smaller

    recipe, look = recipe_of(task.settings, task.edit.seed), style.Look.of(task)

    def one(name: str, model: Gaussians, views: Sequence[View]) -> Gaussians:
        cameras = [smaller(view.camera, task.reduce) for view in views]
        edited, look.losses[name] = stylize_gaussians(
            *(model, cameras, look.picture(name), recipe, look.vgg), title=look.title(name)
        )
        return edited

    return look.result(task.each_model(one))  # type: ignore[arg-type]


def recipe_of(settings: StyleSplatKeys, seed: int = 0) -> Recipe:
    """Its losses: features see every pixel."""
    return replace(settings.recipe(settings.iterations, seed, reduce=1), rate=settings.rate)


METHOD = style.look_method(
    "stylesplat",
    "give a scene of 3D Gaussians the style of a picture, as StyleSplat does",
    StyleSplatKeys,
    run,
    "gaussians",
)
