"""How much of a style a model shows in views that it did not learn from: NNFM, Gram matrices, colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core.camera import Camera
from texgs.core.light import Light
from texgs.core.progress import progress
from texgs.fields.field import Field
from texgs.models.nnfm import StyleFeatures, nnfm
from texgs.models.vgg import Vgg

STRIDE = 4  # pixels between the positions of VGG's features
ON_OBJECT = 0.5  # of alpha, from which a feature counts
OPAQUE = 0.9  # of alpha, from which a pixel's colour counts


@dataclass(frozen=True, eq=False)
class StyleSimilarity:
    """Measures of a view, mean over views; NaN where no view shows enough of the model."""

    nnfm: float  # mean cosine distance of features on the object to the nearest of the style; exact search
    gram: float  # distance of the Gram matrices, relative to the norm of the style's
    color: tuple[float, float, float]  # mean colour of opaque pixels of all views less the style's mean


@torch.no_grad()
def style_similarity(
    model: Field,
    cameras: Sequence[Camera],
    lights: Sequence[Light],
    style: Tensor,
    vgg: Vgg,
    region: Tensor | None = None,
    title: str = "style",
) -> StyleSimilarity:
    """Compare views over white, not trained on and with a light each, with a style.

    The style is [3, h, w] in [0, 1], its longer side that of the views; of it counts the region [h, w] bool.
    """
    device = model.device
    style = style.to(device)
    maps = vgg.features(style)
    part = None
    if region is not None:
        part = F.interpolate(region[None, None].float(), maps.shape[1:], mode="area")[0, 0].to(device) > 0.5
    features = StyleFeatures.of(maps, part)
    target = gram(maps if part is None else maps[:, part])
    distances, grams, colors = [], [], []
    pairs = list(zip(cameras, lights, strict=True))
    for camera, light in progress(pairs, len(pairs), title=title, unit="view"):
        shown = model.render(camera.to(device), light)
        image = shown.color.clamp(0, 1)
        colors.append(image[shown.alpha > OPAQUE])
        seen = vgg.features(image.permute(2, 0, 1))
        where = F.avg_pool2d(shown.alpha[None], STRIDE)[0] > ON_OBJECT
        if bool(where.any()):
            distances.append(float(nnfm(seen, features, where)))
            grams.append(float((gram(seen[:, where]) - target).norm() / target.norm()))
    mean_style = (style.flatten(1) if region is None else style[:, region]).mean(1)
    red, green, blue = (torch.cat(colors).mean(0) - mean_style).tolist()
    return StyleSimilarity(mean(distances), mean(grams), (red, green, blue))


def gram(features: Tensor) -> Tensor:
    """Return the mean products [C, C] of all channels of features [C, ...], float32: which occur together."""
    rows = features.flatten(1).float()
    return rows @ rows.T / rows.shape[1]


def mean(values: Sequence[float]) -> float:
    """Return the mean of numbers; NaN of none."""
    return sum(values) / len(values) if values else float("nan")
