"""Solve for texels from edited views: by preconditioned stochastic steps, or by Adam as in the paper."""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core.geometry import nearest
from texgs.core.progress import progress
from texgs.edit.observations import LinearObservation
from texgs.fields.optimizer import Rate
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import bare_colors, owners
from texgs.raster.losses import l1_dssim

FAINT_GAIN = 1e-4  # gain times alpha below which a pixel carries no information
UNSEEN_SHARE = 0.01  # share of the mean weight below which a texel counts as unseen
FIRST_STEP = 1.5  # share of a Newton step in a typical observation: 2 is the limit of stability
LAST_STEP = 0.1  # length of the last step: smaller steps average out disagreement between views
RIDGE = 0.02  # added to curvatures, relative to their median; it holds texels that are hardly seen
DSSIM = 0.2  # share of D-SSIM in the loss for Adam


@dataclass(frozen=True, eq=False)
class BackProjection:
    """Projective texture: the mean of what edited views want of each texel."""

    colors: Tensor  # [T, 3] mean target of bare colours, in [0, 1]
    weights: Tensor  # [T] sum of weights over pixels, 0 if never seen
    curvature: Tensor  # [T] row sum of the Hessian in a typical observation


def back_project(observations: Sequence[LinearObservation], model: Surfels) -> BackProjection:
    """Average the targets of observations over the pixels that show a texel.

    The curvature is the row sum A'A 1 of one observation, A being the weights of texels in pixels; divided by
    it, no eigenvalue of A'A exceeds 1. Over observations it is the mean weighted by itself, sum c^2 / sum c:
    a texel that few of them show has a small mean and still a large one where it is seen.
    """
    texels = model.parameters["texels"]
    colors, weights = torch.zeros_like(texels), texels.new_zeros(len(texels))
    total, squares = torch.zeros_like(weights), torch.zeros_like(weights)
    for observation in observations:
        ones = torch.ones_like(texels).requires_grad_()
        image = observation.image(ones, plain=True)
        gains = image.detach()[..., :1]  # [h, w, 1]
        shows = gains > FAINT_GAIN
        wanted = observation.wanted
        if observation.is_lit:
            wanted = wanted - observation.image(torch.zeros_like(ones)).detach()
        bare = torch.where(shows, wanted / gains.clamp_min(FAINT_GAIN), 0.0).clamp(0, 1)
        # The rasterizer treats channels alike and apart: two sums share a pass.
        both = torch.cat([shows.to(gains), gains, torch.zeros_like(gains)], dim=-1)
        (sums,) = torch.autograd.grad(image, ones, bare, retain_graph=True)
        (shares,) = torch.autograd.grad(image, ones, both)
        colors += sums
        weights += shares[:, 0]
        total += shares[:, 1]
        squares += shares[:, 1].square()
    tiny = torch.finfo(weights.dtype).tiny
    mean = colors / weights.clamp_min(tiny)[:, None]
    return BackProjection(mean.clamp(0, 1), weights, squares / total.clamp_min(tiny))


def seen_texels(weights: Tensor) -> Tensor:
    """Return which texels [T] views show clearly, rather than through others in front of them."""
    return weights > UNSEEN_SHARE * weights.mean()


def fill_unseen(colors: Tensor, weights: Tensor, model: Surfels) -> Tensor:
    """Return texel colours [T, 3]. Texels that views hardly show take the nearest visible colours.

    That is the mean of the texels of the same surfel, weighted by how much they are seen, [T]; where the
    whole surfel hardly is, that of the nearest one (by its mean) that is seen. So a side that nobody edited
    shows what is around: neither the old colours, nor black, nor what shines through from the other side.
    Where nothing at all is seen, all texels keep their colours.
    """
    place, surfel = owners(model.parameters)
    weight = weights[place]
    of_surfel = weight.new_zeros(len(model)).index_add_(0, surfel, weight)
    if not bool((of_surfel > 0).any()):
        return bare_colors(model)
    totals = colors.new_zeros(len(model), 3).index_add_(0, surfel, colors[place] * weight[:, None])
    mean = totals / of_surfel.clamp_min(torch.finfo(weight.dtype).tiny)[:, None]
    few = UNSEEN_SHARE * of_surfel.mean()
    around = mean[_nearest_known(model.parameters["means"], of_surfel > few)]
    mean = (totals + few * around) / (of_surfel + few)[:, None]
    few = UNSEEN_SHARE * weight.mean()
    filled = colors.clone()
    filled[place] = (colors[place] * weight[:, None] + few * mean[surfel]) / (weight + few)[:, None]
    return filled


def _nearest_known(means: Tensor, known: Tensor) -> Tensor:
    """Return the index [N] of the nearest known surfel; known ones get their own. At least one is known."""
    index = torch.arange(len(means), device=means.device)
    if not bool(known.all()):
        _, neighbours = nearest(means[known], means[~known])
        index[~known] = index[known][neighbours.to(means.device)]
    return index


def solve(
    observations: Sequence[LinearObservation],
    curvature: Tensor,
    start: Tensor,
    *,
    sweeps: int,
    generator: torch.Generator,
    title: str,
) -> Tensor:
    """Return bare colours [T, 3] in [0, 1] by least squares over all observations, one per step.

    Opacities take turns instead of following each other: the problem is one, not a schedule. Texels that are
    not seen keep their colours of the start.
    The order is random in each sweep over all of them. The curvature [T] is that of `back_project`.
    """
    seen = curvature > 0
    ridge = RIDGE * curvature[seen].median() if bool(seen.any()) else 0.0
    scale = torch.where(seen, 1 / (curvature + ridge), 0.0)[:, None]
    colors = start.clone().requires_grad_()
    count = len(observations)
    order = [i for _ in range(sweeps) for i in torch.randperm(count, generator=generator).tolist()]
    for step, index in enumerate(progress(order, title=title, unit="view")):
        image = observations[index].image(colors)
        (gradient,) = torch.autograd.grad(image, colors, image.detach() - observations[index].wanted)
        rate = FIRST_STEP * (LAST_STEP / FIRST_STEP) ** (step / len(order))
        with torch.no_grad():
            colors.addcmul_(gradient, scale, value=-rate).clamp_(0, 1)
    return colors.detach()


def image_loss(observation: LinearObservation, colors: Tensor) -> Tensor:
    """Return L1 + D-SSIM [] between the image of bare colours [T, 3] and the target.

    It is a sum over pixels, so that views with a small visible part do not count more.
    """
    image = observation.image(colors) + observation.rest
    return l1_dssim(image, observation.wanted + observation.rest, DSSIM) * image[..., 0].numel()


def learn(
    observations: Sequence[Sequence[LinearObservation]],
    start: Tensor,
    *,
    rate: Rate,
    steps: int,
    generator: torch.Generator,
    title: str,
) -> Tensor:
    """Learn bare colours [T, 3] in [0, 1] by Adam on L1 + D-SSIM, one observation per step.

    Over all steps the opacity goes from the first row of observations to the last.
    """
    texels = start.clone().requires_grad_()
    adam = torch.optim.Adam([texels], eps=1e-15, fused=True)
    for step in progress(range(steps), title=title, unit="iteration"):
        row = observations[step * len(observations) // steps]
        observation = row[int(torch.randint(len(row), (), generator=generator))]
        adam.param_groups[0]["lr"] = rate.at(step / steps)
        adam.zero_grad(set_to_none=True)
        image_loss(observation, texels).backward()
        adam.step()
        with torch.no_grad():
            texels.clamp_(0, 1)
    return texels.detach()
