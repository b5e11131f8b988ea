"""The paper's baselines that follow pictures: ARF on voxels, StyleSplat on 3D Gaussians, StyleRF-VolVis."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError
from texgs.core.keys import key
from texgs.edit.method import Method
from texgs.edit.methods.style import FeatureKeys, StyleWork, picture_of, require_picture, run

if TYPE_CHECKING:
    from texgs.edit.style_loop import Losses
    from texgs.edit.style_picture import StylePicture
    from texgs.fields.gaussians import Gaussians
    from texgs.fields.palette.model import PaletteField
    from texgs.fields.voxels import Voxels
    from texgs.volume.view_set import View

STYLES = "edit.stylerf.styles"


@dataclass(frozen=True)
class ArfKeys(FeatureKeys):
    """Stylize the colours of voxels (ARF, Zhang et al. 2022)."""

    epochs: float = key(10.0, "rounds through the training views, for the style", least=0)
    ray_epochs: float = key(1.0, "rounds through the rays of recoloured views before that", least=0)
    content: float = key(5e-3, "weight of the features that views have as recoloured", least=0)
    variation: float = key(1.0, "weight of total variation of the image", least=0)
    sh_variation: float = key(5e-3, "weight of total variation of the coefficients", least=0)
    exact: bool = key(True, "colours are moved, not their coefficients as if they were colours (ARF's code)")

    def stylize(
        self, work: StyleWork, name: str, model: Voxels, views: Sequence[View]
    ) -> tuple[Voxels, Losses]:
        """Stylize a grid; features of views and style are computed at half resolution."""
        from texgs.edit.voxels import stylize_voxels
        from texgs.volume.images import load

        recipe = self.recipe(round(self.epochs * len(views)), work.task.edit.seed, reduce=2)
        images, picture = load(views, work.task.reduce), work.picture(name)
        weights = {"content": self.content, "variation": self.variation, "sh_variation": self.sh_variation}
        how = self.ray_epochs, self.exact, weights, work.vgg, work.task.title_of(name)
        return stylize_voxels(model, images, picture, recipe, *how)


@dataclass(frozen=True)
class StyleSplatKeys(FeatureKeys):
    """Stylize the colours of 3D Gaussians (StyleSplat, Jain et al. 2024)."""

    iterations: int = key(2000, "steps of the style, of one view each", least=0)
    rate: float = key(0.005, "learning rate of zeroth harmonics; the others have a twentieth", above=0)

    def stylize(
        self, work: StyleWork, name: str, model: Gaussians, views: Sequence[View]
    ) -> tuple[Gaussians, Losses]:
        """Stylize Gaussians; features are computed at full resolution."""
        from texgs.edit.gaussians import stylize_gaussians
        from texgs.volume.images import smaller

        task = work.task
        recipe = self.recipe(self.iterations, task.edit.seed, reduce=1, rate=self.rate)
        cameras = [smaller(view.camera, task.reduce) for view in views]
        return stylize_gaussians(model, cameras, work.picture(name), recipe, work.vgg, task.title_of(name))


@dataclass(frozen=True)
class StyleRfKeys(FeatureKeys):
    """Stylize palette colours (StyleRF-VolVis, Tang et al. 2024)."""

    styles: list[str] = key(
        [], "a picture for each palette colour of the fit, whatever looks say; default: `style` for all"
    )
    epochs: float = key(5.0, "rounds through the training views, for the style", least=0)
    distillation: int = key(500, "steps before, in which free colours learn the recoloured palette", least=0)
    rate: float = key(1e-2, "learning rate of free colours", above=0)
    variation: float = key(1.0, "weight of total variation of the image", least=0)

    def check(self) -> None:
        """Require existing pictures."""
        super().check()
        for name in self.styles:
            require_picture(name, STYLES)

    def check_fit(self, fit: Any) -> None:
        """Require a style for each palette colour of a fit."""
        if self.styles and len(self.styles) != fit.palette.colors:
            raise ArgumentError(
                f"{STYLES}: expected one for each of {fit.palette.colors} palette colours of "
                f"fit={fit.name}, got {len(self.styles)}; or name one `style` for all"
            )

    def files(self) -> dict[str, Path]:
        """Return the picture files."""
        several = {f"style{i}": Path(name) for i, name in enumerate(self.styles) if Path(name).is_file()}
        return {**super().files(), **several}

    def picture(self) -> StylePicture | None:
        """Return the common style of all palette colours, or None."""
        return None if self.styles else super().picture()

    def followed(self) -> str:
        """Return the names of the pictures."""
        return ", ".join(Path(name).name for name in self.styles or [self.style])

    def stylize(
        self, work: StyleWork, name: str, model: PaletteField, views: Sequence[View]
    ) -> tuple[PaletteField, Losses]:
        """Stylize palette colours; features are computed at half resolution."""
        from texgs.edit.palette_style import stylize_palette
        from texgs.volume.images import load

        task = work.task
        recipe = self.recipe(round(self.epochs * len(views)), task.edit.seed, reduce=2, rate=self.rate)
        pictures = [picture_of(each, STYLES) for each in self.styles]
        work.pictures.update({f"{name}-{index + 1}": each for index, each in enumerate(pictures)})
        pictures = pictures or [work.picture(name)] * len(model.colors)
        images, how = load(views, task.reduce), (self.distillation, self.variation, work.vgg)
        edited, losses, error = stylize_palette(model, images, pictures, recipe, *how, task.title_of(name))
        work.notes.setdefault("distillation_rmse", {})[name] = error
        return edited, losses


METHOD = (
    Method(
        "arf",
        "give a scene of voxels the style of a picture, as ARF does",
        ArfKeys,
        run,
        fields=frozenset({"voxels"}),
        follows="style",
    ),
    Method(
        "stylerf",
        "give a scene of palette fields the styles of pictures, as StyleRF-VolVis does",
        StyleRfKeys,
        run,
        fields=frozenset({"palette"}),
        follows="style",
    ),
    Method(
        "stylesplat",
        "give a scene of 3D Gaussians the style of a picture, as StyleSplat does",
        StyleSplatKeys,
        run,
        fields=frozenset({"gaussians"}),
        follows="style",
    ),
)
