"""Metric `style`: how far views that an edit was not learned from are from the picture that it follows."""

from __future__ import annotations

from math import isfinite
from statistics import fmean

from texgs.metrics.metric import Measure, MeasuredScene, Metric


def run(measured: MeasuredScene) -> dict[str, float]:
    """Measure NNFM and Gram distances of the models with a style, means over them.

    Nothing is returned of looks that follow words or several pictures, or where a model is nowhere opaque.
    """
    import torch

    from texgs.metrics.style import style_similarity
    from texgs.models.vgg import Vgg

    if not measured.styles or not measured.weights["vgg16"]:
        return {}
    scene, device = measured.after, measured.shown.device
    vgg = Vgg.load(device=device, dtype=torch.float32)
    compared = [
        style_similarity(
            scene.models[style.model].open()[0].to(device),
            measured.some,
            [scene.light] * len(measured.some),
            style.image,
            vgg,
            style.region,
            f"{measured.title}, {style.part}",
        )
        for style in measured.styles
    ]
    names = {"style_nnfm": "nnfm", "style_gram": "gram"}
    means = {name: fmean(getattr(each, key) for each in compared) for name, key in names.items()}
    return {name: value for name, value in means.items() if isfinite(value)}


METRIC = Metric(
    "style",
    (Measure("style_nnfm", "NNFM", 3, "down"), Measure("style_gram", "Gram", 3, "down")),
    run,
    order=70,
    is_in_paper=False,
)
