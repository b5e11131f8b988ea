"""The definitions of voxel grids and hash encoding in plain torch: any float type, gradients by autograd."""

from collections.abc import Sequence

import torch
from torch import Tensor
from torch.nn.functional import grid_sample, normalize

from texgs.raster.hash_encoding import HashLevels
from texgs.raster.reference.shading import harmonics

PRIMES = (1, 2654435761, 805459861)
WORD = 1 << 32


def render_rays(
    density: Tensor,  # [X, Y, Z] at the lattice points
    sh: Tensor,  # [X, Y, Z, 1, 4 or 9, 3] coefficients
    lower: Sequence[float],  # world position of voxel (0, 0, 0)
    spacing: float,  # of voxels, world units
    rays: Tensor,  # [N, 6] origin and direction
    background: Sequence[float] = (1.0, 1.0, 1.0),
    step: float = 0.5,  # between samples, in spacings
    transmittance_min: float = 1e-3,  # a ray ends with the sample that leaves less
    depth_range: Tensor | None = None,  # [2, N] in lengths of the direction
) -> tuple[Tensor, Tensor, Tensor]:
    """Return colour [N, 3] over the background, alpha [N], mean distance [N] (Fridovich-Keil et al. 2022)."""
    direction = normalize(rays[:, 3:], dim=1)
    origin = (rays[:, :3] - rays.new_tensor(lower)) / spacing
    near, count = crossing(origin, direction, rays.new_tensor(density.shape) - 1, step)
    k = torch.arange(max(int(count.max()), 1), dtype=rays.dtype, device=rays.device)  # [S]
    distance = near[:, None] + (k + 0.5) * step  # [N, S]
    points = origin[:, None] + distance[..., None] * direction[:, None]  # [N, S, 3]

    sigma = interpolate(density[..., None], points)[..., 0].clamp_min(0) * (k < count[:, None])
    if depth_range is not None:
        first, last = depth_range[..., None] * rays[:, 3:].norm(dim=1)[:, None] / spacing  # [N, 1] each
        sigma = sigma * ((first <= distance) & (distance < last))
    coefficients = interpolate(sh.flatten(3), points).unflatten(-1, sh.shape[3:])  # [N, S, k, 3]
    basis = harmonics(direction)[:, : sh.shape[3]]
    color = (0.5 + torch.einsum("nk,nskc->nsc", basis, coefficients)).clamp_min(0)

    alpha = 1 - torch.exp(-sigma * step * spacing)
    after = torch.cumprod(1 - alpha, dim=1)
    before = torch.cat([torch.ones_like(after[:, :1]), after[:, :-1]], dim=1)
    weight = before * alpha * (before >= transmittance_min)  # [N, S]
    covered = weight.sum(1)
    blended = torch.einsum("ns,nsc->nc", weight, color) + (1 - covered)[:, None] * rays.new_tensor(background)
    depth = (weight * distance).sum(1) * spacing / covered.clamp_min(1e-30)
    return blended, covered, depth


def crossing(origin: Tensor, direction: Tensor, high: Tensor, step: float) -> tuple[Tensor, Tensor]:
    """Return where rays enter the box from 0 to `high`, and the number of samples inside, [N] each."""
    faces = torch.stack([-origin / direction, (high - origin) / direction])  # [2, N, 3]
    near = faces.amin(0).amax(1).clamp_min(0)
    far = faces.amax(0).amin(1)
    return near, ((far - near) / step + 0.5).floor().clamp_min(0)


def interpolate(lattice: Tensor, points: Tensor) -> Tensor:
    """Return the trilinear values [N, S, C] of [X, Y, Z, C] at lattice coordinates [N, S, 3]."""
    high = points.new_tensor(lattice.shape[:3]) - 1
    places = (2 * points / high - 1).flip(-1)[None, :, :, None]  # grid_sample wants z, y, x for [X, Y, Z]
    volume = lattice.permute(3, 0, 1, 2)[None]
    return grid_sample(volume, places, align_corners=True)[0, ..., 0].permute(1, 2, 0)


def encode(points: Tensor, table: Tensor, levels: HashLevels) -> Tensor:
    """Return the features [n, 2 levels] at points [n, 3]; see `texgs.raster.hash_encoding.encode`."""
    features = []
    for resolution, start, end in zip(levels.resolutions, levels.first, levels.first[1:], strict=False):
        place = resolution * points.clamp(0, 1)
        cell = place.detach().long().clamp_max(resolution - 1)
        feature = points.new_zeros(len(points), table.shape[1])
        for corner in torch.cartesian_prod(*[torch.arange(2)] * 3):
            weight = torch.where(corner == 1, place - cell, 1 - (place - cell)).prod(1)
            feature = feature + weight[:, None] * table[start + row(cell + corner, resolution, end - start)]
        features.append(feature)
    return torch.cat(features, dim=1)


def row(point: Tensor, resolution: int, rows: int) -> Tensor:
    """Return the rows [n] of lattice points [n, 3] among those of a level (Mueller et al. 2022, eq. 4)."""
    x, y, z = point.unbind(1)
    if (resolution + 1) ** 3 <= rows:
        return x + (resolution + 1) * (y + (resolution + 1) * z)
    x, y, z = (prime * axis % WORD for prime, axis in zip(PRIMES, (x, y, z), strict=True))
    return (x ^ y ^ z) % rows
