"""PSNR and SSIM of a model on views."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from statistics import fmean

import torch

from texgs.core.ahead import ahead
from texgs.core.progress import progress
from texgs.fields.field import Field
from texgs.metrics.image import psnr, ssim
from texgs.volume.reduced import over_white, smaller
from texgs.volume.view_set import View


@torch.no_grad()
def evaluate(
    model: Field, views: Sequence[View], reduce: int = 1, title: str = "evaluate"
) -> dict[str, list[float]]:
    """PSNR in dB and SSIM of each view over white, full frame, against the exact image.

    Args:
        model: any stage.
        views: to compare with.
        reduce: of the images, as in `images.load`.
        title: of the progress bar.
    """
    measured: dict[str, list[float]] = {"psnr": [], "ssim": []}
    device = model.device
    read = partial(over_white, reduce=reduce)
    for view, planes in progress(ahead(read, views), len(views), title=title, unit="view"):
        target = planes[:3].permute(1, 2, 0).to(device)
        image = model.render(smaller(view.camera, reduce).to(device), view.light).color
        measured["psnr"].append(psnr(image, target))
        measured["ssim"].append(ssim(image, target))
    return measured


def mean(measured: dict[str, list[float]]) -> dict[str, float]:
    """Mean of each metric over the views."""
    return {name: fmean(values) for name, values in measured.items() if values}
