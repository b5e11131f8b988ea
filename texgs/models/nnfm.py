"""Nearest neighbour feature matching: each feature of an image is pulled to the most similar one of a style.

The loss of ARF (Zhang et al. 2022, eq. 3), as in the paper: the mean over positions of the cosine
distance to the nearest feature of the style.
"""

from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core import check
from texgs.core.errors import ArgumentError

SCORES = 1 << 21  # similarities to compute at a time: 8 MB, which fit into caches


@dataclass(frozen=True, eq=False)
class StyleFeatures:
    """Searchable features of a style picture."""

    unit: Tensor  # [S, C] of length 1
    searched: Tensor  # [S, D] float32: the same, or their projection to D principal directions
    basis: Tensor | None  # [C, D] the directions; None: exact search

    @classmethod
    def of(
        cls,
        features: Tensor,
        region: Tensor | None = None,
        positions: int | None = None,
        dimensions: int | None = None,
        seed: int = 0,
    ) -> Self:
        """Gather the features [C, h, w] of a picture, or of its region [h, w] bool.

        At most `positions` are kept, drawn at random. The search uses some principal directions of the
        features; by default all, which is exact.
        """
        size = check.shape("features", features, "C h w")
        rows = draw_features(features.detach(), region, positions, torch.Generator().manual_seed(seed))
        if not len(rows):
            raise ArgumentError("region: expected a part of the style picture, got none of its features")
        exact = F.normalize(rows, dim=1)
        unit = exact.to(features.dtype).contiguous()
        if dimensions is None or dimensions >= size["C"]:
            return cls(unit, exact, None)
        basis = principal(exact, dimensions)
        return cls(unit, (exact - exact.mean(0)) @ basis, basis)

    @torch.no_grad()
    def nearest(self, queries: Tensor) -> Tensor:
        """Return the index [Q] of the style feature with the largest cosine to each query [Q, C]."""
        queries = queries.float()
        if self.basis is not None:
            queries = queries @ self.basis
        step = max(1, SCORES // len(self.searched))
        return torch.cat([best(part @ self.searched.T) for part in queries.split(step)])


def principal(rows: Tensor, dimensions: int) -> Tensor:
    """Return the directions [C, D] in which rows [S, C] differ most.

    What they have in common does not count: it adds the same to all products with a query.
    """
    centred = rows - rows.mean(0)
    return torch.linalg.eigh(centred.T @ centred)[1][:, -dimensions:]


def best(scores: Tensor) -> Tensor:
    """Return the argmax [Q] of each row; on a CPU by NumPy, several times as fast as torch."""
    if scores.is_cuda:
        return scores.argmax(1)
    return torch.from_numpy(scores.numpy().argmax(1))


def nnfm(
    features: Tensor,
    style: StyleFeatures,
    where: Tensor | None = None,
    most: int | None = None,
    seed: int = 0,
) -> Tensor:
    """Return the mean cosine distance [] in [0, 2] of features to their nearest neighbours in the style.

    Differentiable in the features [C, h, w]; which neighbour is nearest is constant for the gradient. Only
    positions `where` [h, w] count, of more than `most` some that are drawn at random; 0 where none does.
    """
    check.shape("features", features, "C h w", C=style.unit.shape[1])
    queries = draw_features(features, where, most, torch.Generator().manual_seed(seed))
    if not len(queries):
        return features.sum().float() * 0
    neighbours = style.unit[style.nearest(queries.detach())]
    return (1 - F.cosine_similarity(queries, neighbours.float(), dim=1, eps=1e-8)).mean()


def draw_features(
    features: Tensor, where: Tensor | None, most: int | None, generator: torch.Generator
) -> Tensor:
    """Return features [n, C] of [C, h, w], float32, where a mask [h, w] is true; at random `most` of them."""
    size, places = check.shape("features", features, "C h w"), None
    if where is not None:
        check.shape("where", where, "h w", h=size["h"], w=size["w"])
        places = where.flatten().nonzero()[:, 0]
    rows = features.permute(1, 2, 0).flatten(0, 1)  # [h w, C], a view where channels are last in memory
    count = len(rows) if places is None else len(places)
    if most is not None and count > most:
        order = torch.randperm(count, generator=generator)[:most].to(rows.device)
        places = order if places is None else places[order]
    return (rows if places is None else rows.index_select(0, places)).float()
