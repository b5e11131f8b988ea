"""How texels follow edited views: by preconditioned stochastic steps, or by Adam as the paper finds them."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from texgs.core.progress import progress
from texgs.edit.back_projection import BackProjection
from texgs.edit.exposures import Exposure
from texgs.fields.optimizer import Rate
from texgs.fields.surfels.model import Surfels
from texgs.raster.losses import l1_dssim

STEP = 1.5  # of a Newton step in a typical exposure: 2 is the limit of stability
LAST_STEP = 0.1  # what single exposures disagree about averages out as steps fall
RIDGE = 0.02  # added to curvatures, relative to their median: texels that are hardly seen stay
DSSIM = 0.2  # share of D-SSIM in what Adam follows


def solve(
    exposures: Sequence[Exposure],
    model: Surfels,
    seen: BackProjection,
    start: Tensor,
    *,
    sweeps: int,
    generator: torch.Generator,
    title: str,
) -> Tensor:
    """Least squares in bare colours over all exposures, one per step, kept in [0, 1].

    Opacities take turns instead of following each other: the problem is one, not a schedule.

    Args:
        exposures: of all views at all opacities.
        model: textured.
        seen: of these exposures.
        start: [T, 3] bare colours.
        sweeps: passes over all exposures.
        generator: of their order.
        title: of the progress bar.

    Returns:
        [T, 3] bare colours in [0, 1]; those of texels that are not seen are those of the start.
    """
    sizes, offsets = model.parameters["sizes"], model.parameters["offsets"]
    scale = _inverse(seen.curvature)[:, None]
    colors = start.clone().requires_grad_()
    order = [i for _ in range(sweeps) for i in torch.randperm(len(exposures), generator=generator).tolist()]
    for step, index in enumerate(progress(order, title=title, unit="view")):
        exposure = exposures[index]
        image = exposure.image(colors, sizes, offsets)
        (gradient,) = torch.autograd.grad(image, colors, image.detach() - exposure.wanted)
        rate = STEP * (LAST_STEP / STEP) ** (step / len(order))
        with torch.no_grad():
            colors.addcmul_(gradient, scale, value=-rate).clamp_(0, 1)
    return colors.detach()


def _inverse(curvature: Tensor) -> Tensor:
    """1 / (curvature + ridge) [T]; 0 where nothing is seen."""
    seen = curvature[curvature > 0]
    if not len(seen):
        return torch.zeros_like(curvature)
    return torch.where(curvature > 0, 1 / (curvature + RIDGE * seen.median()), 0.0)


def learn(
    exposures: Sequence[Sequence[Exposure]],
    model: Surfels,
    start: Tensor,
    *,
    rate: Rate,
    steps: int,
    generator: torch.Generator,
    title: str,
) -> Tensor:
    """Learn bare colours [T, 3] in [0, 1] by Adam on L1 + D-SSIM, one exposure per step.

    Over all steps the opacity goes from the first row of exposures to the last.

    Args:
        exposures: for each opacity those of all views.
        model: textured.
        start: [T, 3] bare colours.
        rate: of Adam, over all steps.
        steps: how many.
        generator: of the order of views.
        title: of the progress bar.
    """
    sizes, offsets = model.parameters["sizes"], model.parameters["offsets"]
    texels = start.clone().requires_grad_()
    adam = torch.optim.Adam([texels], eps=1e-15, fused=True)
    for step in progress(range(steps), title=title, unit="iteration"):
        row = exposures[step * len(exposures) // steps]
        exposure = row[int(torch.randint(len(row), (), generator=generator))]
        beyond = (1 - exposure.cover)[..., None]  # white, in image and target alike
        wanted = (exposure.wanted + beyond).permute(2, 0, 1).contiguous().permute(1, 2, 0)
        image = exposure.image(texels, sizes, offsets) + beyond
        adam.param_groups[0]["lr"] = rate.at(step / steps)
        adam.zero_grad(set_to_none=True)
        l1_dssim(image, wanted, DSSIM).backward()
        adam.step()
        with torch.no_grad():
            texels.clamp_(0, 1)
    return texels.detach()
