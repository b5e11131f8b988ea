"""The definition of the rasterizer: every primitive at every pixel, in plain torch.

Any floating-point type, every result differentiable by autograd, memory proportional to pixels times
primitives. The native rasterizers follow this file; tests compare them with it in float64.
"""

from collections.abc import Collection
from types import ModuleType

import torch
from torch import Tensor
from torch.nn.functional import pad

from texgs.core.errors import ArgumentError
from texgs.raster.reference import gaussians, surfels
from texgs.raster.reference.fragments import Fragments, within
from texgs.raster.types import (
    DEFAULT_OPTIONS,
    Options,
    Render,
    Statistics,
    Texture,
    are_gaussians,
    check_primitive,
)

TEXTURE_SIGMA = 3.0  # standard deviations that a texture spans to either side of the mean


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
    depth_range: Tensor | None = None,
    outputs: Collection[str] = (),
    options: Options = DEFAULT_OPTIONS,
) -> Render:
    """Composite surfels or 3D Gaussians front to back into one view, as `texgs.raster.rasterize` does.

    Differentiable in every floating-point tensor, the camera included. Where `options.alpha_min` and
    `transmittance_min` are 0, what remains is smooth except where surfels change order, or leave a depth
    range. Follows Huang et al. 2024 (2DGS), section 4, and Kerbl et al. 2023 (3DGS), section 4.
    """
    check_primitive(scales, texture is not None, outputs)
    kind, size = kind_of(scales), (width, height)
    projected = kind.project(means, quats, scales, opacities, viewmat, K, shift, size, options)
    fragments = within(kind.intersect(projected, pixel_centres(*size, means), options), depth_range)
    weights, light = composite(fragments.alpha, options.transmittance_min)  # [P, M] each
    image = {"alpha": weights.sum(1), "color": blend(weights, fragments, projected.index, features, texture)}
    if background is not None:
        image["color"] = image["color"] + (1 - image["alpha"][:, None]) * background
    if "depth" in outputs:
        image["depth"] = expected_depth(weights, fragments.depth)
    if "median" in outputs:
        image["median"] = median_depth(weights, light, fragments.depth)
    if "normal" in outputs:
        image["normal"] = weights @ projected.normal
    if "distortion" in outputs:
        image["distortion"] = distortion(weights, fragments.depth, options)
    radii = kind.visible_radii(projected, size, options) if "statistics" in outputs else None
    contributions = None if radii is None else statistics(weights, radii, projected.index, len(means))
    image = {name: x.reshape(height, width, *x.shape[1:]) for name, x in image.items()}
    return Render(**image, statistics=contributions)


def splat(
    image: Tensor,
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    viewmat: Tensor,
    K: Tensor,
    *,
    depth_range: Tensor | None = None,
    options: Options = DEFAULT_OPTIONS,
) -> tuple[Tensor, Tensor]:
    """Return sums [N, C] of blending weight times image [H, W, C], and of weights [N]; see `raster.splat`."""
    height, width, channels = image.shape
    kind = kind_of(scales)
    projected = kind.project(means, quats, scales, opacities, viewmat, K, None, (width, height), options)
    fragments = kind.intersect(projected, pixel_centres(width, height, means), options)
    weights, _ = composite(within(fragments, depth_range).alpha, options.transmittance_min)
    sums = weights.T @ image.reshape(-1, channels)
    return scatter(sums, projected.index, len(means)), scatter(weights.sum(0), projected.index, len(means))


def kind_of(scales: Tensor) -> ModuleType:
    """Return the module with `project`, `intersect` and `visible_radii` of the primitive."""
    return gaussians if are_gaussians(scales) else surfels


def pixel_centres(width: int, height: int, like: Tensor) -> Tensor:
    """Return the pixel centres [H W, 2] as (x, y), row by row."""
    x = torch.arange(width, dtype=like.dtype, device=like.device) + 0.5
    y = torch.arange(height, dtype=like.dtype, device=like.device) + 0.5
    return torch.cartesian_prod(y, x).flip(1)


def composite(alpha: Tensor, transmittance_min: float) -> tuple[Tensor, Tensor]:
    """Return the weights [P, M] of fragments front to back, and the light [P, M] that reaches each."""
    after = torch.cumprod(1 - alpha, 1)
    before = torch.nn.functional.pad(after, (1, 0), value=1.0)[:, :-1]
    return torch.where(after >= transmittance_min, alpha * before, 0.0), before


def blend(
    weights: Tensor, fragments: Fragments, index: Tensor, features: Tensor | None, texture: Texture | None
) -> Tensor:
    """Return the sum over fragments [P, C] of weight times colour, without the background."""
    if features is None and texture is None:
        raise ArgumentError("rasterize: expected features, a texture or both, got neither")
    colors = []
    if texture is not None:
        colors.append((weights[..., None] * texture_color(texture, index, fragments)).sum(1))
    if features is not None:
        colors.append(weights @ features[index])
    return torch.cat(colors, 1)


def texture_color(texture: Texture, index: Tensor, fragments: Fragments) -> Tensor:
    """Return colour [P, M, 3] of each fragment: base + gain * bilinear(texel), the edge texel replicated."""
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
    """Return the mean camera z [P] of the fragments by weight; 0 where nothing is seen."""
    alpha = weights.sum(1)
    seen = alpha > 0
    return torch.where(seen, (weights * depth).sum(1) / torch.where(seen, alpha, 1.0), 0.0)


def median_depth(weights: Tensor, light: Tensor, depth: Tensor) -> Tensor:
    """Return camera z [P] of the last fragment that more than half of the light reaches, or 0."""
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


def statistics(weights: Tensor, radii: Tensor, index: Tensor, n: int) -> Statistics:
    """Return the contribution of each of n primitives, given weights [P, M] and radii [M] at `index`."""
    weights = weights.detach()
    # the padding serves images without pixels
    highest = torch.nn.functional.pad(weights, (0, 0, 0, 1)).amax(0)
    kept = (weights.sum(0), highest, (weights > 0).sum(0), radii.detach())
    return Statistics(*(scatter(x, index, n) for x in kept))


def scatter(values: Tensor, index: Tensor, n: int) -> Tensor:
    """Scatter the values of kept primitives to their places among all n; 0 elsewhere."""
    return values.new_zeros(n, *values.shape[1:]).index_copy(0, index, values)


def cut_range(normals: Tensor, offsets: Tensor, origin: Tensor, rays: Tensor) -> tuple[Tensor, Tensor]:
    """Return `depth_range` and `face` of rays [H, W, 3] with camera z 1 from a point; see `raster.cuts`."""
    slope = rays @ normals.mT  # [H, W, P]: how fast a ray leaves the kept side
    place = (offsets - normals @ origin) / slope.abs()
    enters = torch.where(slope < 0, -place, 0).clamp_min(0)
    near, face = pad(enters, (1, 0)).max(dim=-1)
    far = torch.where(slope >= 0, place, torch.inf).nan_to_num(torch.inf, torch.inf, -torch.inf)
    far = pad(far, (1, 0), value=torch.inf).amin(-1)
    return torch.stack([near, far]), torch.where(near < far, face - 1, -1).int()
