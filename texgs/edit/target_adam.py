"""Bare colours by Adam on L1 + D-SSIM, one exposure per step, as the paper finds them."""

from __future__ import annotations

from collections.abc import Sequence

import torch
from torch import Tensor

from texgs.core.progress import progress
from texgs.edit.exposures import Exposure
from texgs.fields.optimizer import Rate
from texgs.fields.surfels.model import Surfels
from texgs.raster.losses import l1_dssim

DSSIM = 0.2


class Reconstruction:
    """Colours on their way to targets that may change; Adam remembers its moments.

    Args:
        start: [T, 3] bare colours.
        rate: of Adam, over all steps.
        steps: of all calls of `run` together.
    """

    def __init__(self, start: Tensor, rate: Rate, steps: int) -> None:
        self.texels = start.clone().requires_grad_()
        self.rate, self.steps, self.done = rate, steps, 0
        self.adam = torch.optim.Adam([self.texels], eps=1e-15, fused=True)

    @property
    def colors(self) -> Tensor:
        """[T, 3] bare colours of now."""
        return self.texels.detach()

    def run(
        self,
        exposures: Sequence[Sequence[Exposure]],
        model: Surfels,
        count: int,
        generator: torch.Generator,
        title: str,
    ) -> None:
        """Take steps; over all steps the opacity goes from the first row of exposures to the last.

        Args:
            exposures: for each opacity those of all views.
            model: textured.
            count: of steps.
            generator: of the order of views.
            title: of the progress bar.
        """
        sizes, offsets = model.parameters["sizes"], model.parameters["offsets"]
        for _ in progress(range(count), title=title, unit="iteration"):
            row = exposures[min(self.done * len(exposures) // self.steps, len(exposures) - 1)]
            exposure = row[int(torch.randint(len(row), (), generator=generator))]
            beyond = (1 - exposure.cover)[..., None]  # white, in image and target alike
            wanted = (exposure.wanted + beyond).permute(2, 0, 1).contiguous().permute(1, 2, 0)
            image = exposure.image(self.texels, sizes, offsets) + beyond
            self.adam.param_groups[0]["lr"] = self.rate.at(self.done / self.steps)
            self.adam.zero_grad(set_to_none=True)
            l1_dssim(image, wanted, DSSIM).backward()
            self.adam.step()
            with torch.no_grad():
                self.texels.clamp_(0, 1)
            self.done += 1
