"""gsplat's functions in plain torch, made to run without a GPU: `rasterize` with the signature of ours.

gsplat's torch functions get the list of fragments from a CUDA kernel and blend with nerfacc, which has no CPU
code. Here both are replaced by dense loops over all surfels and pixels; projection, intersection, filter and
colours remain gsplat's. Its import is told that there is no CUDA compiler, lest it builds its kernels.
"""

import os
import shutil
import sys
from importlib import import_module
from types import SimpleNamespace
from unittest.mock import patch

import pytest
import torch

from texgs.raster.types import Render


def load(module="_torch_impl_2dgs"):
    """One of gsplat's modules of torch functions; skips the calling test where gsplat is not installed."""
    compiler = shutil.which("nvcc")
    folders = [
        f for f in os.environ["PATH"].split(os.pathsep) if not (compiler and shutil.which("nvcc", path=f))
    ]
    path = patch.dict(os.environ, PATH=os.pathsep.join(folders), CUDA_HOME="", CUDA_PATH="")
    with path, patch("torch.utils.cpp_extension._find_cuda_home", lambda: None):
        pytest.importorskip(
            "gsplat", reason="gsplat is not installed (optional group `bench`)", exc_type=ImportError
        )
        return import_module(f"gsplat.cuda.{module}")


def project(means, quats, scales, viewmat, K, width, height, options):
    """Return centres, depths, homographies and normals of surfels, with a leading axis of one image."""
    thick = torch.cat([scales, torch.ones_like(scales[:, :1])], 1)
    camera = (viewmat[None], K[None], width, height, options.near)
    return load()._fully_fused_projection_2dgs(means, quats, thick, *camera)[1:]


def rasterize(
    means,
    quats,
    scales,
    opacities,
    viewmat,
    K,
    width,
    height,
    *,
    features,
    options,
    background=None,
    listed=None,
    **_,
):
    """Render surfels with gsplat: colour, alpha and normal; `options` with the filter that gsplat has.

    `listed` holds surfel and pixel of each fragment; without, they are searched for.
    """
    gsplat = load()
    assert options.low_pass == 2.0
    assert options.filter_sigma == 1.0
    camera = (viewmat, K, width, height)
    centres, depths, homographies, normals = project(means, quats, scales, *camera, options)
    if listed is None:
        rho = squared_distances(centres[0], homographies[0], (width, height))
        listed = fragments(rho, depths[0], opacities, options)
    surfels, pixels = listed
    with patch.dict(sys.modules, nerfacc=BLENDING):
        tensors = (centres, homographies, opacities[None], features[None], normals, surfels, pixels)
        images = torch.zeros_like(pixels)
        color, alpha, normal = gsplat.accumulate_2dgs(*tensors, images, width, height)
    color, alpha, normal = color[0], alpha[0], normal[0] @ viewmat[:3, :3]  # normals in world axes
    if background is not None:
        color = color + (1 - alpha) * background
    return Render(color=color, alpha=alpha[..., 0], normal=normal)


def rasterize_gaussians(
    means, quats, scales, opacities, viewmat, K, width, height, *, features, background=None, options, **_
):
    """Render 3D Gaussians with gsplat: colour, alpha and, over them, the depth of the means."""
    gsplat, size = load("_torch_impl"), (width, height)
    covariances, _ = gsplat._quat_scale_to_covar_preci(quats, scales, compute_preci=False)
    _, centres, depths, conics, factors = gsplat._fully_fused_projection(
        means,
        covariances,
        viewmat[None],
        K[None],
        *size,
        eps2d=options.dilation,
        near_plane=options.near,
        calc_compensations=options.antialiased,
    )
    if options.antialiased:
        opacities = opacities * factors[0]
    x, y = (at[:, None] - centres[0, :, i] for i, at in enumerate(pixel_centres(*size)))
    xx, xy, yy = conics[0].unbind(1)
    gaussians, pixels = fragments(xx * x**2 + 2 * xy * x * y + yy * y**2, depths[0], opacities, options)
    values = torch.cat([features, depths[0][:, None]], 1)
    with patch.dict(sys.modules, nerfacc=BLENDING):
        color, alpha = gsplat.accumulate(
            centres, conics, opacities[None], values[None], gaussians, pixels, torch.zeros_like(pixels), *size
        )
    color, alpha = color[0], alpha[0]
    depth = torch.where(alpha > 0, color[..., -1:] / torch.where(alpha > 0, alpha, 1), 0)
    color = color[..., :-1]
    if background is not None:
        color = color + (1 - alpha) * background
    return Render(color=color, alpha=alpha[..., 0], depth=depth[..., 0])


def pixel_centres(width, height):
    """Coordinates [P] of the pixel centres along x and along y, row by row."""
    pixel = torch.arange(width * height)
    return pixel % width + 0.5, pixel // width + 0.5


@torch.no_grad()
def squared_distances(centres, homographies, size):
    """Squared distance [P, N] of each pixel from each surfel in standard deviations, low-pass filtered."""
    x, y = (at[:, None] for at in pixel_centres(*size))
    Tu, Tv, Tw = (homographies[None, :, row] for row in range(3))
    # [P, N, 3] planes through the pixel, in surfel space
    p, q = Tw * x[..., None] - Tu, Tw * y[..., None] - Tv
    hit = torch.linalg.cross(p, q)
    rho = ((hit[..., :2] / hit[..., 2:]) ** 2).sum(-1)
    return torch.minimum(rho, 2 * ((x - centres[:, 0]) ** 2 + (y - centres[:, 1]) ** 2))


@torch.no_grad()
def fragments(rho, depths, opacities, options):
    """Primitive and pixel of each fragment that counts, [F] each, pixel by pixel and front to back."""
    order = torch.argsort(depths, stable=True)
    order = order[(depths[order] > options.near) & (opacities[order] >= options.alpha_min)]
    alpha = opacities[order] * torch.exp(-rho[:, order] / 2)
    alpha = torch.where(alpha >= options.alpha_min, alpha, 0)
    kept = (alpha > 0) & (torch.cumprod(1 - alpha, 1) >= options.transmittance_min)
    pixels, primitives = kept.nonzero(as_tuple=True)
    return order[primitives], pixels


def weights_by_ray(alphas, ray_indices, n_rays):
    """Blending weight and light [F] of fragments sorted by ray; one sum over all, so in double precision."""
    logs = torch.log1p(-alphas.double())
    before = torch.cumsum(logs, 0) - logs
    first = torch.searchsorted(ray_indices, torch.arange(n_rays)).clamp(max=max(len(alphas) - 1, 0))
    light = torch.exp(before - before[first][ray_indices]).to(alphas.dtype)
    return alphas * light, light


def sum_by_ray(weights, values, ray_indices, n_rays):
    """Sums [R, C] of weight times value over the fragments of each ray."""
    weighted = weights[:, None] if values is None else weights[:, None] * values
    return weighted.new_zeros(n_rays, weighted.shape[1]).index_add(0, ray_indices, weighted)


BLENDING = SimpleNamespace(render_weight_from_alpha=weights_by_ray, accumulate_along_rays=sum_by_ray)
