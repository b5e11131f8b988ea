"""Palettes of pictures by k-means.

PaletteNeRF and StyleRF-VolVis take the corners of a hull of colours and places (RGBXY) instead. Transfer
functions have a colour each: clusters find these too, and are a call of a library.
"""

from __future__ import annotations

import warnings

import numpy as np
import torch
from torch import Tensor

DRAWN = 50_000  # colours that are clustered


def cluster_colors(colors: Tensor, count: int, seed: int = 0) -> Tensor:
    """Mean colours [count, 3] of clusters of colours [n, 3], the largest cluster first.

    Clusters are of red, green and blue relative to their sum, so that light and shadow on one material are
    one cluster. Where there are fewer, the last colours are those of the largest cluster.

    Args:
        colors: in [0, 1], at least one.
        count: of clusters.
        seed: of the draw of colours and the start.
    """
    from scipy.cluster.vq import kmeans2

    random = np.random.default_rng(seed)
    chosen = torch.from_numpy(random.permutation(len(colors))[:DRAWN])
    colors = colors[chosen].double()
    hues = colors / colors.sum(1, keepdim=True).clamp_min(1e-3)
    distinct = len(np.unique(hues.numpy().round(6), axis=0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of empty clusters
        _, labels = kmeans2(hues.numpy(), min(count, distinct), minit="++", seed=random)
    members = [colors[torch.from_numpy(labels == label)] for label in range(count)]
    members.sort(key=len, reverse=True)
    return torch.stack([(each if len(each) else members[0]).mean(0) for each in members]).float()
