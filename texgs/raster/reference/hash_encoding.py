"""The definition of multi-resolution hash encoding in plain torch: any float type, gradients by autograd."""

import torch
from torch import Tensor

from texgs.raster.hash_encoding import HashLevels

PRIMES = (1, 2654435761, 805459861)
WORD = 1 << 32


def encode(points: Tensor, table: Tensor, levels: HashLevels) -> Tensor:
    """Return the features [n, 2 levels] at points [n, 3]; see `texgs.raster.hash_encoding.encode`."""
    features = []
    for resolution, start, end in zip(levels.resolutions, levels.first, levels.first[1:], strict=False):
        place = resolution * points.clamp(0, 1)
        cell = place.detach().long().clamp_max(resolution - 1)
        feature = points.new_zeros(len(points), table.shape[1])
        for corner in torch.cartesian_prod(*[torch.arange(2)] * 3):
            weight = torch.where(corner == 1, place - cell, 1 - (place - cell)).prod(1)
            feature = feature + weight[:, None] * table[start + row(cell + corner, resolution, end - start)]
        features.append(feature)
    return torch.cat(features, dim=1)


def row(point: Tensor, resolution: int, rows: int) -> Tensor:
    """Return the rows [n] of lattice points [n, 3] among those of a level (Mueller et al. 2022, eq. 4)."""
    x, y, z = point.unbind(1)
    if (resolution + 1) ** 3 <= rows:
        return x + (resolution + 1) * (y + (resolution + 1) * z)
    x, y, z = (prime * axis % WORD for prime, axis in zip(PRIMES, (x, y, z), strict=True))
    return (x ^ y ^ z) % rows
