"""ARF (Zhang et al. 2022), one of the paper's baselines: the style of a picture for voxel grids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from texgs.core.keys import key
from texgs.edit.methods import style
from texgs.edit.methods.style import FeatureKeys

if TYPE_CHECKING:
    from texgs.edit.recipe import Recipe
    from texgs.edit.task import EditedScene, Task
    from texgs.fields.voxels.model import Voxels
    from texgs.volume.view_set import View


@dataclass(frozen=True)
class ArfKeys(FeatureKeys):
    """How colours of voxels take on a style."""

    epochs: float = key(10.0, "rounds through the training views, for the style", least=0)
    ray_epochs: float = key(1.0, "rounds through the rays of recoloured views before that", least=0)
    content: float = key(5e-3, "weight of the features that views have as recoloured", least=0)
    variation: float = key(1.0, "weight of total variation of the image", least=0)
    sh_variation: float = key(5e-3, "weight of total variation of the coefficients", least=0)
    exact: bool = key(True, "colours are moved, not their coefficients as if they were colours (ARF's code)")


def run(task: Task[ArfKeys]) -> EditedScene:
    """Give the models the style; write style.png."""
    from texgs.edit.voxel_style import stylize_voxels
    from texgs.volume.images import load

    keys, look = task.settings, style.Look.of(task)

    def one(name: str, model: Voxels, views: Sequence[View]) -> Voxels:
        recipe = recipe_of(keys, len(views), task.edit.seed)
        edited, look.losses[name] = stylize_voxels(
            *(model, load(views, task.reduce), look.picture(name), recipe, keys, look.vgg),
            title=look.title(name),
        )
        return edited

    scene = task.each_model(one)  # type: ignore[arg-type]
    return look.result(scene)


def recipe_of(settings: ArfKeys, views: int, seed: int = 0) -> Recipe:
    """Its losses for a number of views: features see half of the resolution, and the style too."""
    return settings.recipe(round(settings.epochs * views), seed, reduce=2)


METHOD = style.look_method(
    "arf", "give a scene of voxels the style of a picture, as ARF does", ArfKeys, run, "voxels"
)
