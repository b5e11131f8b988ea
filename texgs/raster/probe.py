"""How fast this machine rasterizes, to compare it with others."""

import statistics
import time

import torch

from texgs.raster import rasterize

REPEATS = 15  # the median counts


def probe() -> float:
    """Return the seconds of a view of 20,000 surfels with its gradients at 400x400 pixels, on all threads."""
    generator = torch.Generator().manual_seed(0)
    means = torch.rand(20000, 3, generator=generator) - 0.5
    colors = torch.rand(20000, 3, generator=generator).requires_grad_()
    quats = torch.randn(20000, 4, generator=generator)
    scales, opacities = torch.full((20000, 2), 0.01), torch.full((20000,), 0.5)
    viewmat, K = torch.eye(4), torch.tensor([[750.0, 0, 200], [0, 750, 200], [0, 0, 1]])
    viewmat[2, 3] = 2.0
    times = []
    for _ in range(REPEATS):
        begin = time.perf_counter()
        shown = rasterize(means, quats, scales, opacities, viewmat, K, 400, 400, features=colors)
        shown.color.sum().backward()
        times.append(time.perf_counter() - begin)
    return statistics.median(times)
