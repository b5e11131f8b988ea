"""How much of a style a view shows that was not learned from: NNFM and Gram matrices."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.models.nnfm import StyleFeatures, nnfm

OBJECT_ALPHA = 0.5  # least mean alpha of a feature that counts


@dataclass(frozen=True, eq=False)
class StyleTarget:
    """What views are compared with: the features of a picture, and which of them occur together."""

    features: StyleFeatures
    gram: Tensor  # [C, C]

    @classmethod
    def of(cls, rows: Tensor) -> Self:
        """Make a target from the features [n, C] of a picture."""
        return cls(StyleFeatures.of(rows.T[:, None]), gram(rows.T))

    def distances(self, rows: Tensor, most: int | None = None, seed: int = 0) -> tuple[float, float]:
        """Return the distances of the features [n, C] of a view from the picture.

        They are the mean cosine distance to the nearest of the picture by exact search, of `most` features
        at random; and the distance of the Gram matrices of all, relative to the norm of the picture's.
        """
        nearest = nnfm(rows.T[:, None], self.features, None, most, seed)
        return float(nearest), float((gram(rows.T) - self.gram).norm() / self.gram.norm())


def on_object(layers: Sequence[Tensor], share: Tensor) -> Tensor:
    """Return layers [c, h, w] as rows [n, C] of the n positions where more than half of a share [H, W] is."""
    height, width = layers[0].shape[1:]
    where = F.adaptive_avg_pool2d(share[None], (height, width))[0] > OBJECT_ALPHA
    return torch.cat([layer.permute(1, 2, 0)[where] for layer in layers], dim=1).float()


def gram(features: Tensor) -> Tensor:
    """Return the mean products [C, C] of all channels of features [C, ...], float32: which occur together."""
    rows = features.flatten(1).float()
    return rows @ rows.T / rows.shape[1]
