"""Sliced Wasserstein distances: the similarity of two textures as whole distributions.

Patches of 7 x 7 colours, or features of VGG, are projected onto random directions; along each the sorted
values of the image are compared with the quantiles of the style (Rabin et al. 2011; Heitz et al. 2021). No
colour or pattern of the style can be left out, while NNFM is content when each feature has some neighbour in
it. The distance of patches needs no pretrained weights.
"""

from dataclasses import dataclass
from typing import Self

import torch
from torch import Tensor
from torch.nn import functional as F

from texgs.core import check
from texgs.models.nnfm import draw_features

SIDE = 7  # side of a patch, pixels
LEVELS = 3  # full resolution, a half, a quarter
FILTERS = 32  # directions in one comparison
BANKS = 12  # sets of directions, used in turn
QUANTILES = 2048  # quantiles of the style for each direction
MAX_PATCHES, MAX_FEATURES = 4096, 2048  # in one comparison
MAX_STYLE_SAMPLES = 16384  # patches or features that represent a style


@dataclass(frozen=True, eq=False)
class PatchStatistics:
    """The distributions of a style's patches along random directions."""

    filters: Tensor  # [BANKS, FILTERS, 3 * SIDE * SIDE] of length 1
    quantiles: tuple[Tensor, ...]  # of each level [BANKS, FILTERS, QUANTILES]

    @classmethod
    def of(cls, picture: Tensor, region: Tensor | None = None, seed: int = 0) -> Self:
        """Project the patches of a picture [3, h, w], centred in a region [h, w] bool, by default anywhere.

        It has at least 7 pixels each way; levels that would be smaller are left out.
        """
        size = check.shape("picture", picture, "3 h w")
        generator = torch.Generator().manual_seed(seed)
        filters = random_directions(3 * SIDE * SIDE, generator).to(picture)
        where = picture.new_ones(size["h"], size["w"]) if region is None else region.to(picture)
        quantiles = []
        for image, mask in pyramid(picture, where):
            inside = mask if bool((mask > 0.5).any()) else torch.ones_like(mask)
            values = filters @ patches(image, centres(inside, MAX_STYLE_SAMPLES, generator)).T
            quantiles.append(kept_quantiles(values))
        return cls(filters.unflatten(0, (BANKS, FILTERS)), tuple(quantiles))

    def distance(self, image: Tensor, where: Tensor | None = None, bank: int = 0, seed: int = 0) -> Tensor:
        """Return the mean squared distance [] of sorted projections of patches to the style's, over levels.

        Differentiable in the image [3, H, W]. Patches count that are centred where a mask [H, W] is above
        1/2, by default all; 0 where none does. The bank of directions is taken modulo their count. The seed
        is of the draw of 4,096 patches where there are more.
        """
        size = check.shape("image", image, "3 H W")
        where = image.new_ones(size["H"], size["W"]) if where is None else where.to(image)
        check.shape("where", where, "H W", H=size["H"], W=size["W"])
        generator, bank = torch.Generator().manual_seed(seed), bank % BANKS
        distances = []
        for (level, mask), quantiles in zip(pyramid(image, where), self.quantiles, strict=False):
            chosen = centres(mask, MAX_PATCHES, generator)
            if len(chosen):
                values = self.filters[bank] @ patches(level, chosen).T  # [FILTERS, n]
                distances.append(to_quantiles(values, quantiles[bank]))
        return torch.stack(distances).mean() if distances else image.sum() * 0


@dataclass(frozen=True, eq=False)
class FeatureDistribution:
    """The distributions of a style's features along random directions."""

    directions: Tensor  # [BANKS, FILTERS, C] of length 1
    quantiles: Tensor  # [BANKS, FILTERS, QUANTILES]
    variance: Tensor  # [] along a direction, mean over them

    @classmethod
    def of(cls, features: Tensor, region: Tensor | None = None, seed: int = 0) -> Self:
        """Project the features [C, h, w] of a picture, those of a region [h, w] bool, by default all.

        The seed is of the directions, and of the draw of 16,384 features where there are more.
        """
        generator = torch.Generator().manual_seed(seed)
        rows = draw_features(features.detach(), region, MAX_STYLE_SAMPLES, generator)
        directions = random_directions(rows.shape[1], generator).to(rows)
        values = directions @ rows.T
        return cls(directions.unflatten(0, (BANKS, FILTERS)), kept_quantiles(values), values.var(1).mean())

    def distance(self, features: Tensor, where: Tensor | None = None, bank: int = 0, seed: int = 0) -> Tensor:
        """Return the mean squared distance [] of sorted projections of features to the style's, by variance.

        1 for features [C, h, w] that are all alike and of the right mean. Differentiable in them. They count
        at positions [h, w] bool, by default at all; 0 where none does. The bank of directions is taken modulo
        their count. The seed is of the draw of 2,048 features where there are more.
        """
        check.shape("features", features, "C h w", C=self.directions.shape[2])
        rows = draw_features(features, where, MAX_FEATURES, torch.Generator().manual_seed(seed))
        if not len(rows):
            return features.sum().float() * 0
        bank %= BANKS
        return to_quantiles(self.directions[bank] @ rows.T, self.quantiles[bank]) / self.variance


def random_directions(channels: int, generator: torch.Generator) -> Tensor:
    """Return directions [BANKS * FILTERS, channels] of length 1."""
    return F.normalize(torch.randn(BANKS * FILTERS, channels, generator=generator), dim=1)


def kept_quantiles(values: Tensor) -> Tensor:
    """Return what is kept of the projections [BANKS * FILTERS, n] of a style: [BANKS, FILTERS, QUANTILES]."""
    targets = at_quantiles(values.gather(1, ranking(values)), QUANTILES)
    return targets.unflatten(0, (BANKS, FILTERS))


def pyramid(image: Tensor, where: Tensor) -> list[tuple[Tensor, Tensor]]:
    """Return the image [3, h, w] and what counts of its patches' centres [h - 6, w - 6], at each level."""
    scales, margin = [], SIDE // 2
    for level in range(LEVELS):
        if level:
            image, where = (F.avg_pool2d(x[None], 2)[0] for x in (image, where[None]))
            where = where[0]
        if min(image.shape[1:]) < SIDE:
            break
        scales.append((image, where[margin:-margin, margin:-margin]))
    return scales


def centres(where: Tensor, most: int, generator: torch.Generator) -> Tensor:
    """Return rows and columns [n, 2] at which a mask [h, w] is above 1/2; `most` of them, drawn at random."""
    places = (where > 0.5).nonzero()
    if len(places) > most:
        places = places[torch.randperm(len(places), generator=generator)[:most].to(places.device)]
    return places


def patches(image: Tensor, corners: Tensor) -> Tensor:
    """Return patches [n, 3 * 7 * 7] of an image [3, h, w], their first pixel at rows and columns [n, 2].

    Only those wanted are gathered: a convolution of the whole image takes longer, above all backwards.
    """
    height, width = image.shape[1:]
    steps = torch.arange(SIDE, device=image.device)
    plane = torch.arange(3, device=image.device) * height * width
    within = (plane[:, None, None] + steps[:, None] * width + steps).flatten()  # [147]
    places = (corners[:, 0] * width + corners[:, 1])[:, None] + within
    return image.flatten().index_select(0, places.flatten()).view(places.shape)


def at_quantiles(values: Tensor, count: int) -> Tensor:
    """Return the quantiles (i + 1/2) / count of sorted values [F, n], as [F, count], linear in between."""
    place = (torch.arange(count, device=values.device) + 0.5) / count * values.shape[1] - 0.5
    place = place.clamp(0, values.shape[1] - 1)
    low = place.long()
    high = (low + 1).clamp_max(values.shape[1] - 1)
    return torch.lerp(values[:, low], values[:, high], (place - low).to(values))


def to_quantiles(values: Tensor, quantiles: Tensor) -> Tensor:
    """Return the mean squared distance [] of values [F, n] to a sample of n with these quantiles [F, K].

    The order of the values is constant for the gradient, as it is for that of sorting.
    """
    order = ranking(values.detach())
    targets = torch.empty_like(values).scatter_(1, order, at_quantiles(quantiles, values.shape[1]))
    return (values - targets).square().mean()


def ranking(values: Tensor) -> Tensor:
    """Return indices [F, n] that sort each row; on a CPU by NumPy, several times as fast as torch."""
    if values.is_cuda:
        return values.argsort(dim=1)
    return torch.from_numpy(values.numpy().argsort(axis=1))
