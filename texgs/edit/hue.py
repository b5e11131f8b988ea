"""How far a look may leave the hue of the function that it lies on, so that a legend still holds.

What a look is learned from, a picture or edited views, is moved to this hue beforehand, a loss keeps it
there, and nothing goes farther in the end. Lightness and texture are free. Hues are chromaticities, which
light does not change, see `texgs.core.oklab`.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor

from texgs.core.oklab import DARKEST, brightness, chromaticity, from_oklab, oklab
from texgs.edit.canvas import require_editable
from texgs.edit.observations import straight_colors
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import owners

WEIGHT = 30.0  # of the loss
ALIKE = 0.05  # distance of functions that are hardly told by their hues
ALONE = 0.2  # distance to the next function where there is none
DARK_TONES = 0.3  # lightness of black in a look with a bound, as black has no hue
LIGHT_TONES = 0.98  # share of the colours that stay apart when all get darker, as far as a hue requires
SAMPLES = 1 << 20  # colours, at most, to find by how much


@dataclass(frozen=True, eq=False)
class HueBound:
    """The hues of a function where its surfels are, and how far a look may go from them."""

    hues: Tensor  # [N, 2]
    middle: Tensor  # [2] mean of the surfels that take the look
    reach: float  # distance

    @classmethod
    def of(cls, models: Mapping[str, Surfels], name: str, surfels: Tensor | None, share: float) -> Self:
        """Let a look on some surfels [N] bool of a model, or all, go a share of the way to the next function.

        Models are as fitted, by name; the next function is that of the most similar palette. Those that are
        not textured have none.
        """
        require_editable(models[name], surfels)
        p = models[name].parameters
        hues = chromaticity((p["colors"] + p["palette"]).clamp(0, 1))
        middle = (hues if surfels is None else hues[surfels]).mean(0)
        others = (each.parameters for key, each in models.items() if key != name and each.stage == "texture")
        apart = min((float((middle - chromaticity(q["palette"])).norm()) for q in others), default=ALONE)
        return cls(hues, middle, share * max(apart, ALIKE))

    def toned(self, colors: Tensor) -> Tensor:
        """Move colours [..., 3] in [0, 1] as near to the mean hue as they have to be.

        All get darker alike where light ones cannot be shown in this hue: they would no longer differ.
        """
        moved = self._moved(colors, self.middle)
        lightness = moved[..., :1].clamp_min(DARKEST)
        moved = moved * (DARK_TONES / lightness + 1 - DARK_TONES)
        bright = brightness(moved).flatten()
        bright = bright[:: -(-len(bright) // SAMPLES)].quantile(LIGHT_TONES).clamp_min(1)
        return from_oklab(moved * bright ** (-1 / 3))

    def toned_views(self, images: Tensor, alphas: Tensor) -> Tensor:
        """Move the colours of views [V, H, W, 3] over white; the white stays."""
        straight = torch.stack([straight_colors(*each) for each in zip(images, alphas, strict=True)])
        return self.toned(straight) * alphas[..., None] + 1 - alphas[..., None]

    def loss(self, image: Tensor) -> dict[str, Tensor]:
        """Return the weighted mean square [] of how far pixels [3, h, w] are beyond; differentiable."""
        away = (chromaticity(image.permute(1, 2, 0)) - self.middle).square().sum(-1)
        within = max(self.reach, 1e-4)  # a root has no gradient at 0
        return {"hue": WEIGHT * (away.clamp_min(within**2).sqrt() - within).square().mean()}

    def at_texels(self, colors: Tensor, model: Surfels) -> Tensor:
        """Return colours [T, 3] of texels, learned for the mean hue, around the hue of each surfel."""
        place, surfel = owners(model.parameters)
        own = torch.zeros_like(colors[:, :2]).index_copy_(0, place, self.hues[surfel])
        return from_oklab(self._moved(colors, own))

    def _moved(self, colors: Tensor, around: Tensor) -> Tensor:
        """Return OKLab [..., 3] of colours as far from some hues [..., 2] as from the mean, or the reach."""
        lightness, steps = oklab(colors)[..., :1], chromaticity(colors) - self.middle
        steps = steps * (self.reach / steps.norm(dim=-1, keepdim=True).clamp_min(1e-6)).clamp_max(1)
        return torch.cat([lightness, lightness.clamp_min(DARKEST) * (around + steps)], dim=-1)
