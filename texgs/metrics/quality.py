"""PSNR and SSIM of a model on views."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from statistics import fmean
from typing import TypeVar

import torch

from texgs.core.progress import progress
from texgs.fields.field import Field
from texgs.metrics.image import psnr, ssim
from texgs.volume.images import over_white, smaller
from texgs.volume.view_set import View

Item = TypeVar("Item")
Read = TypeVar("Read")


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
    for view, planes in progress(read_ahead(read, views), len(views), title=title, unit="view"):
        target = planes[:3].permute(1, 2, 0).to(device)
        image = model.render(smaller(view.camera, reduce).to(device), view.light).color
        measured["psnr"].append(psnr(image, target))
        measured["ssim"].append(ssim(image, target))
    return measured


def mean(measured: dict[str, list[float]]) -> dict[str, float]:
    """Mean of each metric over the views."""
    return {name: fmean(values) for name, values in measured.items() if values}


def read_ahead(read: Callable[[Item], Read], items: Iterable[Item]) -> Iterator[tuple[Item, Read]]:
    """Yield each item with what `read` makes of it, in order; the next one is read meanwhile.

    An error of `read` is raised where its item would come.

    Args:
        read: called in one other thread, one item after the other.
        items: iterated in the caller's thread.
    """
    with ThreadPoolExecutor(1) as pool:
        before: tuple[Item, Future[Read]] | None = None
        for item in items:
            following = item, pool.submit(read, item)
            if before is not None:
                yield before[0], before[1].result()
            before = following
        if before is not None:
            yield before[0], before[1].result()
