"""Texels by preconditioned stochastic steps: with geometry and shading frozen, images are linear in them."""

from __future__ import annotations

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, FitError
from texgs.core.progress import progress
from texgs.fields.bounds import visible_part
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.texels import footprint
from texgs.fit.texture_layout import Sight
from texgs.raster.losses import l1_dssim
from texgs.volume.images import Images, Target

STEP = 0.6  # of a Newton step in a typical view: 2 is the limit of stability, and views differ
LAST_STEP = 0.06  # noise of single views averages out as steps fall
CHECKED = 12  # views in which texels must have lowered the error
STRUCTURE = 1e-3  # weight of D-SSIM against half the mean squared error


def solve(
    model: Surfels, images: Images, sight: Sight, *, sweeps: int, ridge: float, seed: int, title: str
) -> Surfels:
    """Fit the texels to all views: least squares, with a little D-SSIM, one view per step.

    A step divides the gradient by an estimate of the row sums A'A 1 of the Hessian in one view, A being the
    weights of texels in its pixels: by the row sums themselves, no eigenvalue would exceed 1.

    Args:
        model: textured, texels where to start.
        images: training views.
        sight: of the model with the texels where to start.
        sweeps: passes over all views.
        ridge: added to that estimate, relative to its median; it keeps texels that are hardly seen in place.
        seed: of the order of views.
        title: of the progress bar.

    Returns:
        The model with new texels; the one given, if these would not lower the squared error.
    """
    texels = model.parameters["texels"].clone().requires_grad_()
    moving = Surfels({**model.parameters, "texels": texels}, model.shading, model.metadata)
    scale = _inverse(curvature(model.parameters["sizes"], sight.curvature), ridge)
    generator = torch.Generator().manual_seed(seed)
    order = [i for _ in range(sweeps) for i in torch.randperm(len(images), generator=generator).tolist()]
    for step, index in enumerate(progress(order, title=title, unit="view")):
        target = visible_part(images, index, model.parameters, model.shading.options)
        image = moving.render(target.camera, target.light).color
        structure = STRUCTURE * image.numel() * l1_dssim(image, target.color, 1.0)
        loss = 0.5 * squared_error(image, target) + structure
        (gradient,) = torch.autograd.grad(loss, texels)
        rate = STEP * (LAST_STEP / STEP) ** (step / len(order))
        with torch.no_grad():
            texels.addcmul_(gradient, scale, value=-rate)
    try:
        check.finite(texels=texels)
    except ArgumentError as error:
        raise FitError(
            f"texture: {error}; the training views or the model of the phase before are damaged"
        ) from error
    solved = Surfels({**model.parameters, "texels": texels.detach()}, model.shading, model.metadata)
    return solved if sampled_error(solved, images) <= sampled_error(model, images) else model


def squared_error(image: Tensor, target: Target) -> Tensor:
    """Sum [] over pixels and channels."""
    return (image - target.color).square().sum()


@torch.no_grad()
def sampled_error(model: Surfels, images: Images) -> float:
    """Squared error of some views, evenly spaced, with colours clamped as on a screen."""
    device = model.device
    targets = [images.target(i, device) for i in range(0, len(images), max(1, len(images) // CHECKED))]
    errors = [squared_error(model.render(t.camera, t.light).color.clamp(0, 1), t) for t in targets]
    return float(torch.stack(errors).sum())


def curvature(sizes: Tensor, of_surfels: Tensor) -> Tensor:
    """Share [T, 1] of each texel in the curvature of its surfel.

    Args:
        sizes: texels along u and v [N, 2], one surfel after the other.
        of_surfels: [N].
    """
    owner = torch.repeat_interleave(sizes.long().prod(dim=1))  # [T]
    return (footprint(sizes) * of_surfels[owner])[:, None]


def _inverse(curvatures: Tensor, ridge: float) -> Tensor:
    """1 / (curvature + ridge * median) [T, 1]; 0 where nothing is seen at all."""
    seen = curvatures[curvatures > 0]
    if not len(seen):
        return torch.zeros_like(curvatures)
    damped = curvatures + ridge * seen.median()
    return torch.where(damped > 0, 1 / damped, 0.0)
