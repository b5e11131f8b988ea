"""PSNR, SSIM and the share shown, as defined for the tables, of images and of a model on views."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import partial
from statistics import fmean
from typing import TypeVar

import torch
from torch import Tensor
from torch.nn.functional import avg_pool2d

from texgs.core.progress import progress
from texgs.fields.field import Field
from texgs.raster import Render
from texgs.raster.losses import ssim as structural_similarity
from texgs.raster.reference.losses import similarities
from texgs.volume.images import over_white, smaller
from texgs.volume.view_set import View

MAX_PSNR = 100.0  # dB, of equal images
VISIBLE_ALPHA = 0.01  # alpha of a pixel on the object, in one of two images
WINDOW = 3  # pixels; side of a square whose mean alpha is compared
KEPT_ALPHA = 0.5  # share of that mean
WHOLE_SHARE = 0.995  # complete fits have 0.997 or more; a bonsai without some leaves has 0.991
Item = TypeVar("Item")
Read = TypeVar("Read")


def psnr(image: Tensor, target: Tensor) -> float:
    """Return the PSNR in dB of an image [H, W, C], clamped to [0, 1], over all pixels; 100 if equal."""
    from kornia.metrics import psnr as of_unit_range

    return min(of_unit_range(image.clamp(0, 1), target, 1.0).item(), MAX_PSNR)  # NaN stays NaN


def ssim(image: Tensor, target: Tensor) -> float:
    """Return the structural similarity; see `texgs.raster.losses.ssim`."""
    return structural_similarity(image.clamp(0, 1), target).item()


def compare(image: Render, target: Render) -> dict[str, float]:
    """Return PSNR in dB and SSIM of two images: full frame, and on the object, the visible part of either.

    `shown` is the share of the target that the image shows, see `shown_share`.
    """
    shown = image.color.clamp(0, 1)
    scores = {"psnr": psnr(shown, target.color), "ssim": ssim(shown, target.color)}
    if bool((seen := object_of(image, target)).any()):
        scores["object_psnr"] = psnr(shown[seen], target.color[seen])
        scores["object_ssim"] = similarities(shown, target.color)[seen].mean().item()
    share = shown_share(image.alpha, target.alpha)
    return scores if share is None else {**scores, "shown": share}


def object_of(image: Render, target: Render) -> Tensor:
    """Return the pixels [H, W] that are visible in one of two images."""
    return (image.alpha > VISIBLE_ALPHA) | (target.alpha > VISIBLE_ALPHA)


def shown_share(alpha: Tensor, truth: Tensor) -> float | None:
    """Return the share of a view's alpha [H, W] where a model has at least half, both as 3 x 3 means.

    None where the view shows nothing; faint noise has little weight. What is finer than pixels differs from
    one to the next, and faint matter by a tenth of its alpha, in fits that have all parts: neither counts.
    The sum of the smaller alpha of both would count them as 0.07 of what there is.
    """
    whole = float(truth.sum())
    if not whole:
        return None
    near, expected = (avg_pool2d(x[None, None], WINDOW, 1, WINDOW // 2)[0, 0] for x in (alpha, truth))
    return float(truth[near >= KEPT_ALPHA * expected].sum()) / whole


def what_is_lost(share: float | None) -> str:
    """Return a warning with advice for a fit that misses parts, or ""."""
    if share is None or share >= WHOLE_SHARE:
        return ""
    return (
        f"the model shows {100 * share:.1f} % of what test views show, so that parts are missing; fit it in "
        "larger views, by fit=default, or with a larger cap of densify"
    )


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
    """Yield each item with `read(item)`, in order; another thread reads ahead by one.

    An error of `read` is raised at the turn of its item.
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
