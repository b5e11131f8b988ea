"""The definition of the rasterizer: every surfel at every pixel, in plain torch.

Any floating-point type, every result differentiable by autograd, memory proportional to pixels times surfels.
The native rasterizers follow this file; tests compare them with it in float64.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.raster.reference.projection import Projected, project, visible_radii
from texgs.raster.types import DEFAULT_OPTIONS, Options, Render, Statistics, Texture

ALPHA_MAX = 0.99  # no fragment takes all light, so that those behind it still receive a gradient
TEXTURE_SIGMA = 3.0  # a texture spans so many standard deviations to either side of the mean


@dataclass(frozen=True)
class Fragments:
    """Each of the M surfels at each of the P pixels."""

    u: Tensor  # [P, M] intersection in standard deviations along the first tangent
    v: Tensor  # [P, M] ... the second
    depth: Tensor  # [P, M] camera z; that of the mean where the low-pass filter wins
    alpha: Tensor  # [P, M] 0 where skipped


def rasterize(
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    viewmat: Tensor,
    K: Tensor,
    width: int,
    height: int,
    *,
    features: Tensor | None = None,
    texture: Texture | None = None,
    background: Tensor | None = None,
    shift: Tensor | None = None,
    outputs: Collection[str] = (),
    options: Options = DEFAULT_OPTIONS,
) -> Render:
    """Composite surfels front to back into one view, as `texgs.raster.rasterize` does.

    Differentiable in every floating-point tensor, the camera included. `options.alpha_min = 0` and
    `options.transmittance_min = 0` switch the two thresholds off: what remains is smooth except where surfels
    change order. Follows Huang et al. 2024 (2DGS), section 4.

    Args:
        means: [N, 3] world units.
        quats: [N, 4] wxyz, of any length but zero.
        scales: [N, 2] standard deviations along the tangents, world units.
        opacities: [N] in [0, 1].
        viewmat: [4, 4] world to camera, OpenCV axes.
        K: [3, 3] intrinsics in pixels, without skew; pixel centres lie at +0.5.
        width: of the image in pixels.
        height: of the image in pixels.
        features: [N, C] one colour per surfel; or else
        texture: a colour that varies over the surfel.
        background: [C], black by default.
        shift: [N, 2] pixels added to the whole projection of a surfel, zero by default.
        outputs: any of "depth", "median", "normal", "distortion", "statistics".
        options: filter, thresholds and depth range.

    Returns:
        Render with color [H, W, C], alpha [H, W], and the outputs asked for.
    """
    surfels = project(means, quats, scales, opacities, viewmat, K, shift, options)
    fragments = intersect(surfels, pixel_centres(width, height, means), options)
    weights, light = composite(fragments.alpha, options.transmittance_min)  # [P, M] each
    alpha = weights.sum(1)
    color = blend(weights, fragments, surfels, features, texture)
    if background is not None:
        color = color + (1 - alpha[:, None]) * background

    image = {"color": color, "alpha": alpha}
    if "depth" in outputs:
        image["depth"] = expected_depth(weights, fragments.depth)
    if "median" in outputs:
        image["median"] = median_depth(weights, light, fragments.depth)
    if "normal" in outputs:
        image["normal"] = weights @ surfels.normal
    if "distortion" in outputs:
        image["distortion"] = distortion(weights, fragments.depth, options)
    contributions = None
    if "statistics" in outputs:
        contributions = statistics(weights, surfels, len(means), (width, height), options)
    image = {name: x.reshape(height, width, *x.shape[1:]) for name, x in image.items()}
    return Render(image.pop("color"), image.pop("alpha"), **image, statistics=contributions)


def splat(
    image: Tensor,
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    viewmat: Tensor,
    K: Tensor,
    *,
    options: Options = DEFAULT_OPTIONS,
) -> tuple[Tensor, Tensor]:
    """Splat an image [H, W, C] back onto the surfels: the adjoint of rendering features over black.

    Returns:
        Sums [N, C] over all pixels of blending weight times image, and the sums [N] of the weights.
    """
    height, width, channels = image.shape
    surfels = project(means, quats, scales, opacities, viewmat, K, None, options)
    fragments = intersect(surfels, pixel_centres(width, height, means), options)
    weights, _ = composite(fragments.alpha, options.transmittance_min)
    sums = weights.T @ image.reshape(-1, channels)
    return scatter(sums, surfels.index, len(means)), scatter(weights.sum(0), surfels.index, len(means))


def pixel_centres(width: int, height: int, like: Tensor) -> Tensor:
    """Pixel centres [H W, 2] as (x, y), row by row."""
    x = torch.arange(width, dtype=like.dtype, device=like.device) + 0.5
    y = torch.arange(height, dtype=like.dtype, device=like.device) + 0.5
    return torch.cartesian_prod(y, x).flip(1)


def intersect(surfels: Projected, pixels: Tensor, options: Options) -> Fragments:
    """Intersect the ray of each pixel [P, 2] with the plane of each surfel."""
    Tu, Tv, Tw = surfels.homography.unbind(1)  # [M, 3] each
    inverse = torch.stack(
        [torch.linalg.cross(*pair) for pair in ((Tv, Tw), (Tw, Tu), (Tu, Tv))], 2
    )  # [M, 3, 3]
    homogeneous = torch.nn.functional.pad(pixels, (0, 1), value=1.0)  # [P, 3] (x, y, 1)
    U, V, W = torch.einsum("mij,pj->ipm", inverse, homogeneous)  # [P, M] each
    parallel = W.abs() < torch.finfo(W.dtype).tiny ** 0.25  # so that squares and gradients stay finite
    W = torch.where(parallel, torch.ones_like(W), W)
    u, v = U / W, V / W
    z = surfels.depth + u * surfels.tangent_depth[:, 0] + v * surfels.tangent_depth[:, 1]

    hit = (z > options.near) & ~parallel
    rho_surfel = torch.where(hit, u**2 + v**2, math.inf)
    rho_filter = options.low_pass * ((pixels[:, None, :] - surfels.centre) ** 2).sum(2)
    filtered = rho_filter < rho_surfel
    rho = torch.where(filtered, rho_filter, rho_surfel)
    alpha = (surfels.opacity * torch.exp(-rho / 2)).clamp(max=ALPHA_MAX)
    return Fragments(
        u=u,
        v=v,
        depth=torch.where(filtered | ~hit, surfels.depth, z),
        alpha=torch.where(alpha >= options.alpha_min, alpha, 0.0),
    )


def composite(alpha: Tensor, transmittance_min: float) -> tuple[Tensor, Tensor]:
    """Blending weights [P, M] of fragments front to back, and the light [P, M] that reaches each of them."""
    after = torch.cumprod(1 - alpha, 1)
    before = torch.nn.functional.pad(after, (1, 0), value=1.0)[:, :-1]
    return torch.where(after >= transmittance_min, alpha * before, 0.0), before


def blend(
    weights: Tensor,
    fragments: Fragments,
    surfels: Projected,
    features: Tensor | None,
    texture: Texture | None,
) -> Tensor:
    """Sum over fragments [P, C] of weight times colour, without the background."""
    if features is not None and texture is None:
        return weights @ features[surfels.index]
    if features is None and texture is not None:
        return (weights[..., None] * texture_color(texture, surfels.index, fragments)).sum(1)
    given = "both" if texture is not None else "neither"
    raise ArgumentError(f"rasterize: expected either features or texture, got {given}")


def texture_color(texture: Texture, index: Tensor, fragments: Fragments) -> Tensor:
    """Colour [P, M, 3] of each fragment: base + gain * bilinear(texel), the edge texel replicated."""
    sizes, offsets = texture.sizes[index].long(), texture.offsets[index]
    corners, fractions = [], []
    for axis, coordinate in enumerate((fragments.u, fragments.v)):
        last = sizes[:, axis] - 1
        x = (coordinate / (2 * TEXTURE_SIGMA) + 0.5) * sizes[:, axis] - 0.5
        x = torch.minimum(x.clamp(min=0), last.to(x.dtype))  # [P, M]
        low = x.detach().floor().long()
        corners.append((low, torch.minimum(low + 1, last)))
        fractions.append((x - low)[..., None])

    def fetch(i: Tensor, j: Tensor) -> Tensor:
        return texture.texels[offsets + j * sizes[:, 0] + i]

    (i0, i1), (j0, j1) = corners
    top = torch.lerp(fetch(i0, j0), fetch(i1, j0), fractions[0])
    bottom = torch.lerp(fetch(i0, j1), fetch(i1, j1), fractions[0])
    return texture.base[index] + texture.gain[index][:, None] * torch.lerp(top, bottom, fractions[1])


def expected_depth(weights: Tensor, depth: Tensor) -> Tensor:
    """Mean camera z [P] of the fragments by weight; 0 where nothing is seen."""
    alpha = weights.sum(1)
    seen = alpha > 0
    return torch.where(seen, (weights * depth).sum(1) / torch.where(seen, alpha, 1.0), 0.0)


def median_depth(weights: Tensor, light: Tensor, depth: Tensor) -> Tensor:
    """Camera z [P] of the last fragment that more than half of the light reaches; 0 where none is."""
    candidates = (weights > 0) & (light > 0.5)  # [P, M]
    position = torch.arange(1, depth.shape[1] + 1, device=depth.device)
    last = torch.cat([position.new_zeros(len(depth), 1), candidates * position], 1).amax(1)  # 0: none
    return torch.nn.functional.pad(depth, (1, 0)).gather(1, last[:, None])[:, 0]


def distortion(weights: Tensor, depth: Tensor, options: Options) -> Tensor:
    """Sum over pairs of fragments [P] of w_i w_j (m_i - m_j)^2, as in 2DGS but of squared differences."""
    # m is the depth in normalised device coordinates, 0 at near and 1 at far
    far = min(options.far, 1e30)  # infinite: far / (far - near) is 1
    m = far / (far - options.near) * (1 - options.near / depth)
    return weights.sum(1) * (weights * m**2).sum(1) - (weights * m).sum(1) ** 2


def statistics(
    weights: Tensor, surfels: Projected, n: int, size: tuple[int, int], options: Options
) -> Statistics:
    """Contribution of each of the n surfels to an image of size (width, height)."""
    weights = weights.detach()
    # the padding serves images without pixels
    highest = torch.nn.functional.pad(weights, (0, 0, 0, 1)).amax(0)
    radii = visible_radii(surfels, *size, options).detach()
    kept = (weights.sum(0), highest, (weights > 0).sum(0), radii)
    return Statistics(*(scatter(x, surfels.index, n) for x in kept))


def scatter(values: Tensor, index: Tensor, n: int) -> Tensor:
    """Values of the kept surfels at their places among all n; 0 elsewhere."""
    return values.new_zeros(n, *values.shape[1:]).index_copy(0, index, values)
