"""The list that holds the texels of all surfels: whose each is, and what each surfel's come to."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import Tensor


def owners(parameters: Mapping[str, Tensor]) -> tuple[Tensor, Tensor]:
    """Place in the list [T] and surfel [T] of all texels, surfel after surfel, whatever order they are in."""
    counts = parameters["sizes"].long().prod(1)  # [N]
    surfel = torch.repeat_interleave(counts)
    first = counts.cumsum(0) - counts  # [N] in the new order
    within = torch.arange(len(surfel), device=surfel.device) - first[surfel]
    return parameters["offsets"][surfel] + within, surfel


def mean_texels(parameters: Mapping[str, Tensor]) -> Tensor:
    """Mean texel of each surfel [N, 3], float64."""
    texels = parameters["texels"].double()
    running = torch.cat([texels.new_zeros(1, 3), texels.cumsum(0)])  # [T + 1, 3]
    counts, offsets = parameters["sizes"].long().prod(1), parameters["offsets"]  # [N]
    return (running[offsets + counts] - running[offsets]) / counts[:, None]
