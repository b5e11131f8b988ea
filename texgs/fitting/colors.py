"""Colours of an object in views: their mean, and their largest clusters."""

import warnings

import numpy as np
import torch
from torch import Tensor

from texgs.volume.images import Images

DRAWN_COLORS = 50_000  # colours to cluster
OPAQUE_ALPHA = 128  # alpha (of 255) from which the colour of a pixel counts


def mean_color(images: Images) -> Tensor:
    """Return the mean colour [3] of images weighted by alpha, black if all are empty."""
    total = images.planes.new_zeros(4, dtype=torch.float64)
    for planes in images.planes:
        total += planes.sum(dim=(1, 2), dtype=torch.int64)
    color, alpha = total[:3], total[3]
    premultiplied = color - (255.0 * images.planes[:, 3].numel() - alpha)  # without the white behind
    return (premultiplied / alpha.clamp_min(1)).clamp(0, 1).float()


def cluster_colors(colors: Tensor, count: int, seed: int = 0) -> Tensor:
    """Return mean colours [count, 3] of clusters of colours [n, 3], the largest cluster first.

    Clusters are of red, green and blue relative to their sum, so that light and shadow on one material are
    one cluster. Where there are fewer, the last colours are those of the largest cluster. PaletteNeRF and
    StyleRF-VolVis take the corners of a hull of colours and places (RGBXY) instead. Transfer functions have a
    colour each: clusters find these too, and are a call of a library.
    """
    from scipy.cluster.vq import kmeans2

    random = np.random.default_rng(seed)
    chosen = torch.from_numpy(random.permutation(len(colors))[:DRAWN_COLORS])
    colors = colors[chosen].double()
    hues = colors / colors.sum(1, keepdim=True).clamp_min(1e-3)
    distinct = len(np.unique(hues.numpy().round(6), axis=0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)  # of empty clusters
        _, labels = kmeans2(hues.numpy(), min(count, distinct), minit="++", seed=random)
    members = [colors[torch.from_numpy(labels == label)] for label in range(count)]
    members.sort(key=len, reverse=True)
    return torch.stack([(each if len(each) else members[0]).mean(0) for each in members]).float()


def object_palette(images: Images, count: int, seed: int) -> Tensor:
    """Cluster the colours of all pixels that are opaque enough, or of the most opaque ones, [count, 3]."""
    alpha = images.planes[:, 3]
    opaque = alpha >= min(int(alpha.max()), OPAQUE_ALPHA)
    share = alpha[opaque, None].float() / 255
    colors = images.planes.permute(0, 2, 3, 1)[opaque][:, :3].float() / 255
    return cluster_colors(((colors - 1 + share) / share).clamp(0, 1), count, seed)
