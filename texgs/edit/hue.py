"""How far a look may leave the hue of the function that it lies on, so that a legend still holds.

What a look is learned from, a picture or edited views, is moved to this hue beforehand; lightness and texture
stay. Hues are chromaticities, see `texgs.core.oklab`: light does not change them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor

from texgs.core.oklab import DARKEST, brightness, chromaticity, from_oklab, oklab
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import owners

LIGHT_TONES = 0.98  # share of the colours that stay apart when all get darker, as far as a hue requires
SAMPLES = 1 << 20  # colours, at most, to find by how much


@dataclass(frozen=True, eq=False)
class HueBound:
    """The hues of a function where its surfels are, and the share of the way from them that a look may go."""

    hues: Tensor  # [N, 2]
    middle: Tensor  # [2] mean of the surfels that take the look
    share: float  # in [0, 1]

    @classmethod
    def of(cls, fitted: Surfels, surfels: Tensor | None, share: float) -> Self:
        """Read the hues of a model as fitted, of which surfels [N] bool take the look; None: all."""
        p = fitted.parameters
        hues = chromaticity((p["colors"] + p["palette"]).clamp(0, 1))
        return cls(hues, (hues if surfels is None else hues[surfels]).mean(0), share)

    def toned(self, colors: Tensor) -> Tensor:
        """Move colours [..., 3] in [0, 1] to the mean hue, except for a share of the way.

        All get darker alike where light ones cannot be shown in this hue: they would no longer differ.
        """
        moved = moved_hues(colors, lambda own: torch.lerp(self.middle.expand_as(own), own, self.share))
        bright = brightness(moved).flatten()
        bright = bright[:: -(-len(bright) // SAMPLES)].quantile(LIGHT_TONES).clamp_min(1)
        return from_oklab(moved * bright ** (-1 / 3))

    def at_texels(self, colors: Tensor, model: Surfels) -> Tensor:
        """Return colours [T, 3] of a model's texels, for the mean hue, moved as the hue of each surfel differs."""
        place, surfel = owners(model.parameters)
        steps = torch.zeros_like(colors[:, :2]).index_copy_(0, place, (self.hues - self.middle)[surfel])
        return from_oklab(moved_hues(colors, lambda own: own + steps))


def moved_hues(colors: Tensor, move: Callable[[Tensor], Tensor]) -> Tensor:
    """Return OKLab [..., 3] of colours [..., 3] in [0, 1] with a function of their chromaticities [..., 2]."""
    lightness = oklab(colors)[..., :1]
    return torch.cat([lightness, lightness.clamp_min(DARKEST) * move(chromaticity(colors))], dim=-1)
