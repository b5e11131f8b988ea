"""PSNR and SSIM, as the tables define them, of images and of a model on views."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from statistics import fmean
from typing import TypeVar

import torch
from torch import Tensor

from texgs.core.progress import progress
from texgs.fields.field import Field
from texgs.metrics.shown import shown_share
from texgs.raster import Render
from texgs.raster.losses import ssim as structural_similarity
from texgs.raster.reference.losses import similarities
from texgs.volume.images import over_white, smaller
from texgs.volume.view_set import View

BEST = 100.0  # dB, of equal images
VISIBLE = 0.01  # alpha; pixels of an object have more in one of two images
Item = TypeVar("Item")
Read = TypeVar("Read")


def psnr(image: Tensor, target: Tensor) -> float:
    """Return the PSNR in dB of an image [H, W, C], clamped to [0, 1], over all pixels; 100 if equal."""
    from kornia.metrics import psnr as of_unit_range

    return min(of_unit_range(image.clamp(0, 1), target, 1.0).item(), BEST)  # NaN stays NaN


def ssim(image: Tensor, target: Tensor) -> float:
    """Return the structural similarity; see `texgs.raster.losses.ssim`."""
    return structural_similarity(image.clamp(0, 1), target).item()


def compare(image: Render, target: Render) -> dict[str, float]:
    """Return PSNR in dB and SSIM of two images: full frame, and on the object, where one shows something.

    Of what the target shows, `shown` is the share that the image shows, see `shown_share`.
    """
    shown = image.color.clamp(0, 1)
    scores = {"psnr": psnr(shown, target.color), "ssim": ssim(shown, target.color)}
    if bool((seen := object_of(image, target)).any()):
        scores["object_psnr"] = psnr(shown[seen], target.color[seen])
        scores["object_ssim"] = similarities(shown, target.color)[seen].mean().item()
    share = shown_share(image.alpha, target.alpha)
    return scores if share is None else {**scores, "shown": share}


def object_of(image: Render, target: Render) -> Tensor:
    """Return the pixels [H, W] in which one of two images shows something."""
    return (image.alpha > VISIBLE) | (target.alpha > VISIBLE)


@torch.no_grad()
def evaluate(
    model: Field, views: Sequence[View], reduce: int = 1, title: str = "evaluate"
) -> dict[str, list[float]]:
    """Return PSNR in dB and SSIM of each view over white, full frame, against the exact image.

    The images are reduced as in `images.load`. Views with alpha have the PSNR on the object, too,
    and the share `shown` of what they show, see `shown_share`.
    """
    measured: dict[str, list[float]] = {"psnr": [], "ssim": [], "object_psnr": [], "shown": []}
    device = model.device
    read = partial(over_white, reduce=reduce)
    for view, planes in progress(read_ahead(read, views), len(views), title=title, unit="view"):
        planes = planes.to(device)
        target = Render(planes[:3].permute(1, 2, 0), planes[3])
        image = model.render(smaller(view.camera, reduce).to(device), view.light)
        measured["psnr"].append(psnr(image.color, target.color))
        measured["ssim"].append(ssim(image.color, target.color))
        seen = object_of(image, target)
        if bool(seen.any()) and bool((target.alpha < 1).any()):
            measured["object_psnr"].append(psnr(image.color[seen], target.color[seen]))
            if (share := shown_share(image.alpha, target.alpha)) is not None:
                measured["shown"].append(share)
    return measured


def mean(measured: dict[str, list[float]]) -> dict[str, float]:
    """Return the mean of each metric over the views."""
    return {name: fmean(values) for name, values in measured.items() if values}


def read_ahead(read: Callable[[Item], Read], items: Iterable[Item]) -> Iterator[tuple[Item, Read]]:
    """Yield each item with what `read` makes of it, in order; another thread reads the next one meanwhile.

    An error of `read` is raised where its item would come.
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
