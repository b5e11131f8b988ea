"""Sliced Wasserstein distance of VGG features: how alike their whole distributions are, block by block.

NNFM is content when each feature has some neighbour in the style; a few kinds of it are enough. This distance
wants every kind as often as the style has it (Heitz et al. 2021), of fine patterns as well as of coarse ones.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core import check
from texgs.edit.sliced import BANKS, FILTERS, QUANTILES, STYLE_MOST, at_quantiles, ranking, to_quantiles
from texgs.models.nnfm import drawn

MOST = 2048  # features of one comparison


@dataclass(frozen=True, eq=False)
class FeatureDistribution:
    """What the features of a style look like along random directions."""

    directions: Tensor  # [BANKS, FILTERS, C] of length 1
    quantiles: Tensor  # [BANKS, FILTERS, QUANTILES]
    variance: Tensor  # [] along a direction, mean over them

    @classmethod
    def of(cls, features: Tensor, region: Tensor | None = None, seed: int = 0) -> FeatureDistribution:
        """Project the features of a picture.

        Args:
            features: [C, h, w].
            region: [h, w] bool, what of the picture counts; by default all.
            seed: of the directions, and of the draw of 16,384 features where there are more.
        """
        generator = torch.Generator().manual_seed(seed)
        rows = drawn(features.detach(), region, STYLE_MOST, generator)
        directions = F.normalize(torch.randn(BANKS * FILTERS, rows.shape[1], generator=generator), dim=1)
        directions = directions.to(rows)
        values = directions @ rows.T
        targets = at_quantiles(values.gather(1, ranking(values)), QUANTILES)
        shape = (BANKS, FILTERS)
        return cls(directions.unflatten(0, shape), targets.unflatten(0, shape), values.var(1).mean())

    def distance(self, features: Tensor, where: Tensor | None = None, bank: int = 0, seed: int = 0) -> Tensor:
        """Mean squared distance [] of the sorted projections of features to those of the style, by variance.

        1 for features that are all alike and of the right mean. Differentiable in them; 0 where none counts.

        Args:
            features: [C, h, w] of an image, from the same layer.
            where: [h, w] bool, positions that count; by default all.
            bank: set of directions, any number: it is taken modulo their count.
            seed: of the draw of 2,048 features where there are more.
        """
        check.shape("features", features, "C h w", C=self.directions.shape[2])
        rows = drawn(features, where, MOST, torch.Generator().manual_seed(seed))
        if not len(rows):
            return features.sum().float() * 0
        bank %= len(self.directions)
        return to_quantiles(self.directions[bank] @ rows.T, self.quantiles[bank]) / self.variance
