"""Metric `style`: the distance of held-out views from the picture that an edit follows."""

from __future__ import annotations

from dataclasses import replace
from statistics import fmean
from typing import TYPE_CHECKING

from texgs.metrics.metric import Measure, MeasuredScene, Metric, SeenView, Style

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.fields.field import Composed
    from texgs.metrics.style import StyleTarget
    from texgs.scene.scene import Scene

QUERIES = 250  # features of a view to match; more give the same result


def run(measured: MeasuredScene) -> Distances | dict[str, float]:
    """Measure NNFM and Gram distances of all, or of the models with a picture each, means over them.

    Nothing is measured for looks that follow words or several pictures, or if a model is nowhere opaque.
    """
    return Distances(measured) if measured.styles and measured.vgg else {}


class Distances:
    """Measures distances of views to pictures."""

    def __init__(self, measured: MeasuredScene) -> None:
        self.measured = measured
        self.targets = [self.target(style) for style in measured.styles]
        self.distances: list[list[tuple[float, float]]] = [[] for _ in self.targets]
        self.alone = {style.model: alone(measured, style.model) for style in measured.styles if style.model}

    def target(self, style: Style) -> StyleTarget:
        """Return the features of a picture's region, or of all of it if the region is too thin."""
        import torch

        from texgs.metrics.style import StyleTarget

        image = style.image.to(self.measured.shown.device)
        rows = self.features(image, style.region.float())
        if not len(rows):  # lines too thin for any position
            rows = self.features(image, torch.ones_like(style.region).float())
        return StyleTarget.of(rows)

    def features(self, image: Tensor, share: Tensor) -> Tensor:
        """Return the features [n, C] of the part of an image with a share [H, W]."""
        from texgs.metrics.style import on_object
        from texgs.models.vgg import STYLE_LAYERS

        assert self.measured.vgg is not None
        layers = self.measured.vgg.layers(image[None], STYLE_LAYERS)
        return on_object([layer[0] for layer in layers], share.to(image.device))

    def see(self, view: SeenView) -> None:
        """Measure a view; VGG-16 runs again for each model with its own picture."""
        for style, target, pairs in zip(self.measured.styles, self.targets, self.distances, strict=True):
            rows = self.seen(view, style)
            pairs += [target.distances(rows, QUERIES, view.place)] if len(rows) else []

    def seen(self, view: SeenView, style: Style) -> Tensor:
        """Return the features [n, C] of the part that follows a picture."""
        from texgs.metrics.style import on_object
        from texgs.models.vgg import STYLE_LAYERS

        if style.model is None:
            return on_object([view.layers[name][0] for name in STYLE_LAYERS], view.alpha)
        scene, opened = self.alone[style.model]
        shown = opened.render(self.measured.cameras[view.place], scene.light, scene.edits)
        return self.features(shown.color.clamp(0, 1).permute(2, 0, 1), shown.alpha)

    def values(self) -> dict[str, float]:
        """Return the means over views and pictures; nothing if a picture's part is in no view."""
        if not all(self.distances):
            return {}
        means = [map(fmean, zip(*pairs, strict=True)) for pairs in self.distances]
        return dict(zip(("style_nnfm", "style_gram"), map(fmean, zip(*means, strict=True)), strict=True))


def alone(measured: MeasuredScene, name: str) -> tuple[Scene, Composed]:
    """Return the scene of one model, and its composition."""
    scene = replace(measured.after, models={name: measured.after.models[name]})
    return scene, scene.open(measured.shown.device)


METRIC = Metric(
    "style",
    (Measure("style_nnfm", "NNFM", 3, "down"), Measure("style_gram", "Gram", 3, "down")),
    run,
    order=70,
    is_in_paper=False,
)
