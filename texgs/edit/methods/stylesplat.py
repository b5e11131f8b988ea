"""StyleSplat (Jain et al. 2024), one of the paper's baselines: the style of a picture for 3D Gaussians."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from texgs.core.keys import key
from texgs.edit.method import Method
from texgs.edit.methods.style import FeatureKeys, StyleWork, run

if TYPE_CHECKING:
    from texgs.edit.style_loop import Losses
    from texgs.fields.gaussians import Gaussians
    from texgs.volume.view_set import View


@dataclass(frozen=True)
class StyleSplatKeys(FeatureKeys):
    """How colours of 3D Gaussians take on a style."""

    iterations: int = key(2000, "steps of the style, of one view each", least=0)
    rate: float = key(0.005, "learning rate of zeroth harmonics; the others have a twentieth", above=0)

    def stylize(
        self, work: StyleWork, name: str, model: Gaussians, views: Sequence[View]
    ) -> tuple[Gaussians, Losses]:
        """Give Gaussians the style of their picture; features see every pixel."""
        from texgs.edit.gaussians import stylize_gaussians
        from texgs.volume.images import smaller

        task = work.task
        recipe = self.recipe(self.iterations, task.edit.seed, reduce=1, rate=self.rate)
        cameras = [smaller(view.camera, task.reduce) for view in views]
        return stylize_gaussians(model, cameras, work.picture(name), recipe, work.vgg, task.title_of(name))


METHOD = Method(
    "stylesplat",
    "give a scene of 3D Gaussians the style of a picture, as StyleSplat does",
    StyleSplatKeys,
    run,
    fields=frozenset({"gaussians"}),
    follows="style",
)
