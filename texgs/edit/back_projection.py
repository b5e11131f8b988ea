"""What edited views say about each texel, before anything is solved: a projective texture."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.edit.exposures import Exposure
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import bare_colors, owners

FAINT = 1e-4  # gain times alpha below which a pixel says nothing
HARDLY = 0.01  # of the mean weight: what is seen less than that is hardly seen


@dataclass(frozen=True, eq=False)
class BackProjection:
    """Sums over all exposures, for each texel."""

    colors: Tensor  # [T, 3] mean of the bare colours wanted where it is seen, in [0, 1]
    weights: Tensor  # [T] sum of its weights in pixels, 0 where it is never seen
    curvature: Tensor  # [T] row sum of the Hessian in a typical exposure


def back_project(exposures: Sequence[Exposure], model: Surfels) -> BackProjection:
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


def seen_texels(weights: Tensor) -> Tensor:
    """Which texels [T] views really show: not those glimpsed through what is in front of them."""
    return weights > HARDLY * weights.mean()


def fill_unseen(sums: BackProjection, model: Surfels) -> Tensor:
    """Mean colours [T, 3] of texels, with those that views hardly show drawn to what is seen nearest to them.

    That is the mean of the texels of the same surfel, weighted by how much they are seen; where the whole
    surfel hardly is, that of the nearest one (by its mean) that is seen. So a side that nobody edited shows
    what is around: neither the old colours, nor black, nor what shines through from the other side. Where
    nothing at all is seen, all texels keep their colours.

    Args:
        sums: of all exposures.
        model: textured.
    """
    place, surfel = owners(model.parameters)
    weight = sums.weights[place]
    of_surfel = weight.new_zeros(len(model)).index_add_(0, surfel, weight)
    if not bool((of_surfel > 0).any()):
        return bare_colors(model)
    totals = sums.colors.new_zeros(len(model), 3).index_add_(0, surfel, sums.colors[place] * weight[:, None])
    tiny = torch.finfo(weight.dtype).tiny
    mean = totals / of_surfel.clamp_min(tiny)[:, None]
    few = HARDLY * of_surfel.mean()
    around = mean[_nearest(model.parameters["means"], of_surfel > few)]
    mean = (totals + few * around) / (of_surfel + few)[:, None]
    few = HARDLY * weight.mean()
    filled = sums.colors.clone()
    filled[place] = (sums.colors[place] * weight[:, None] + few * mean[surfel]) / (weight + few)[:, None]
    return filled


def _nearest(means: Tensor, known: Tensor) -> Tensor:
    """Index [N] of the nearest of the known surfels, of which there is one; of these themselves their own."""
    from scipy.spatial import cKDTree

    index = torch.arange(len(means), device=means.device)
    if bool(known.all()):
        return index
    ids, points, is_known = known.nonzero()[:, 0], means.detach().cpu().numpy(), known.cpu().numpy()
    _, nearest = cKDTree(points[is_known]).query(points[~is_known])
    index[~known] = ids[torch.as_tensor(nearest, device=ids.device)]
    return index
