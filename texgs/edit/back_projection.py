"""What edited views say about each texel, before anything is solved: a projective texture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.edit.exposures import Exposure
from texgs.scene.model import Model
from texgs.scene.texels import owners

FAINT = 1e-4  # gain times alpha below which a pixel says nothing


@dataclass(frozen=True, eq=False)
class BackProjection:
    """Sums over all exposures, for each texel."""

    colors: Tensor  # [T, 3] mean of the bare colours wanted where it is seen, in [0, 1]
    weights: Tensor  # [T] sum of its weights in pixels, 0 where it is never seen
    curvature: Tensor  # [T] row sum of the Hessian in a typical exposure


def back_project(exposures: Sequence[Exposure], model: Model) -> BackProjection:
    """Average what exposures want over the pixels that show a texel.

    The curvature is the row sum A'A 1 of one exposure, A being the weights of texels in pixels; divided by
    it, no eigenvalue of A'A exceeds 1. Over exposures it is the mean weighted by itself, sum c^2 / sum c: a
    texel that few of them show has a small mean and still a large one where it is seen.
    """
    p = model.parameters
    count = len(p["texels"])
    colors, weights = torch.zeros_like(p["texels"]), p["texels"].new_zeros(count)
    total, squares = torch.zeros_like(weights), torch.zeros_like(weights)
    for exposure in exposures:
        ones = torch.ones_like(p["texels"]).requires_grad_()
        image = exposure.image(ones, p["sizes"], p["offsets"], plain=True)
        gains = image.detach()[..., :1]  # [h, w, 1]
        shows = gains > FAINT
        wanted = exposure.wanted
        if exposure.is_lit:
            wanted = wanted - exposure.image(torch.zeros_like(ones), p["sizes"], p["offsets"]).detach()
        bare = torch.where(shows, wanted / gains.clamp_min(FAINT), 0.0).clamp(0, 1)
        # The rasterizer treats channels alike and apart: two sums share a pass.
        both = torch.cat([shows.to(gains), gains, torch.zeros_like(gains)], dim=-1)
        (sums,) = torch.autograd.grad(image, ones, bare, retain_graph=True)
        (shares,) = torch.autograd.grad(image, ones, both)
        colors += sums
        weights += shares[:, 0]
        total += shares[:, 1]
        squares += shares[:, 1].square()
    mean = colors / weights.clamp_min(torch.finfo(weights.dtype).tiny)[:, None]
    return BackProjection(mean.clamp(0, 1), weights, squares / total.clamp_min(torch.finfo(total.dtype).tiny))


def fill_unseen(colors: Tensor, weights: Tensor, model: Model) -> Tensor:
    """Colours [T, 3] with those of texels that no view shows made up from what is seen nearest to them.

    Such a texel gets the mean of the seen texels of its surfel, weighted by how much they are seen; where
    none is, that of the nearest surfel (by its mean) that has any. So a view that nobody edited shows what is
    around, and neither the old colours nor black.

    Args:
        colors: [T, 3]; only those with a weight count.
        weights: [T], 0 where a texel is not seen.
        model: textured.
    """
    from scipy.spatial import cKDTree

    place, surfel = owners(model.parameters)
    n = len(model)
    weight = weights.new_zeros(n).index_add_(0, surfel, weights[place])
    sums = colors.new_zeros(n, 3).index_add_(0, surfel, colors[place] * weights[place][:, None])
    seen = weight > 0
    if not bool(seen.any()):
        return colors
    mean = sums / weight.clamp_min(torch.finfo(weight.dtype).tiny)[:, None]
    if not bool(seen.all()):
        means = model.parameters["means"].cpu()
        known = seen.nonzero()[:, 0]
        _, nearest = cKDTree(means[known.cpu()].numpy()).query(means[~seen.cpu()].numpy())
        mean[~seen] = mean[known[torch.as_tensor(nearest, device=known.device)]]
    filled = colors.clone()
    is_unseen = weights[place] == 0
    filled[place[is_unseen]] = mean[surfel[is_unseen]]
    return filled
