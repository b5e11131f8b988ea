"""ARF (Zhang et al. 2022), one of the paper's baselines: the style of a picture for voxel grids."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from texgs.core.keys import key
from texgs.edit.method import Method
from texgs.edit.methods.style import FeatureKeys, StyleWork, run

if TYPE_CHECKING:
    from texgs.edit.style_loop import Losses
    from texgs.fields.voxels import Voxels
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

    def stylize(
        self, work: StyleWork, name: str, model: Voxels, views: Sequence[View]
    ) -> tuple[Voxels, Losses]:
        """Give a grid the style of its picture; features see half of the resolution, and the style too."""
        from texgs.edit.voxels import stylize_voxels
        from texgs.volume.images import load

        recipe = self.recipe(round(self.epochs * len(views)), work.task.edit.seed, reduce=2)
        images, picture = load(views, work.task.reduce), work.picture(name)
        weights = {"content": self.content, "variation": self.variation, "sh_variation": self.sh_variation}
        how = self.ray_epochs, self.exact, weights, work.vgg, work.task.title_of(name)
        return stylize_voxels(model, images, picture, recipe, *how)


METHOD = Method(
    "arf",
    "give a scene of voxels the style of a picture, as ARF does",
    ArfKeys,
    run,
    fields=frozenset({"voxels"}),
    follows="style",
)
