"""Generated scenes that load a rasterizer like fitted ones: three nested, closed shells of surfels.

Measured at 60 000 surfels: 53 % of the pixels of a 400 x 400 image and 52 % of 800 x 800 are covered, and the
blended fragments per covered pixel are

| scene       | 400 x 400 | 800 x 800 |
|-------------|-----------|-----------|
| light       |      21.8 |      19.9 |
| opaque      |      38.6 |      38.2 |
| heavy       |      62.2 |      62.6 |
| transl      |      32.4 |      31.7 |
| translheavy |     109.6 |     110.2 |
"""

import math
from dataclasses import dataclass

import torch
from kornia.geometry.conversions import rotation_matrix_to_quaternion
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.camera import Camera, orbit

# Of the surfels: wavy sphere of radius 1, torus inside it, sphere inside the torus.
SHARES = (0.55, 0.27, 0.18)
WAVE = 0.06  # largest amplitude of the wavy sphere
RING, TUBE = 0.74, 0.18  # radii of the torus
INNER = 0.55  # radius of the inner sphere


@dataclass(frozen=True)
class Kind:
    """How much the surfels of a scene overlap, and how much light they let through."""

    sigma: tuple[float, float]  # standard deviations in units of the mean spacing of surfels
    opacity: tuple[float, float]


KINDS = {
    "light": Kind(sigma=(0.33, 0.55), opacity=(0.3, 0.95)),
    "opaque": Kind(sigma=(0.5, 0.8), opacity=(0.3, 0.95)),
    "heavy": Kind(sigma=(1.0, 1.5), opacity=(0.3, 0.95)),
    "transl": Kind(sigma=(0.5, 0.8), opacity=(0.05, 0.3)),
    "translheavy": Kind(sigma=(1.0, 1.5), opacity=(0.05, 0.3)),
}


def surfels(kind: str, n: int = 60_000, seed: int = 0) -> dict[str, Tensor]:
    """Surfels of one of KINDS on the three shells, float32, in random order.

    Returns:
        means [N, 3], quats [N, 4], scales [N, 2], opacities [N] and features [N, 3], under these names.
    """
    generator = torch.Generator().manual_seed(seed)

    def uniform(low: float, high: float, *shape: int) -> Tensor:
        return low + (high - low) * torch.rand(*shape, generator=generator)

    counts = [round(share * n) for share in SHARES[1:]]
    shells = [wavy_sphere(n - sum(counts)), torus(counts[0]), sphere(counts[1])]
    order = torch.randperm(n, generator=generator)
    means = torch.cat([points for points, _ in shells])[order].float()
    normals = torch.cat([normals for _, normals in shells])[order].float()
    area = 4 * math.pi * (1 + INNER**2 + math.pi * RING * TUBE)
    spacing = math.sqrt(area / max(n, 1))
    return {
        "means": means,
        "quats": facing(normals, uniform(0, 2 * math.pi, n)),
        "scales": spacing * uniform(*KINDS[kind].sigma, n, 2),
        "opacities": uniform(*KINDS[kind].opacity, n),
        "features": (0.5 + 0.4 * torch.sin(3 * means) + uniform(-0.1, 0.1, n, 3)).clamp(0, 1),
    }


def gaussians(kind: str, n: int = 60_000, seed: int = 0, thickness: float = 0.3) -> dict[str, Tensor]:
    """The surfels of a scene as 3D Gaussians: scales [N, 3], the third in units of the smaller one."""
    made = surfels(kind, n, seed)
    third = thickness * made["scales"].amin(1, keepdim=True)
    return made | {"scales": torch.cat([made["scales"], third], 1)}


def camera(size: int) -> Camera:
    """Square view with a field of view of 45 degrees in which the scenes cover 52 % of the pixels."""
    return orbit(azimuth=-60.0, polar=25.0, radius=3.2, fov_y=45.0, width=size, height=size)


def evenly_spread(n: int) -> tuple[Tensor, Tensor]:
    """Points of [0, 1)^2 without gaps and clusters, each coordinate [N] (Roberts 2018, the R2 sequence)."""
    i = torch.arange(n, dtype=torch.float64) + 0.5
    plastic = 1.3247179572447460  # the real root of x^3 = x + 1
    return (i / plastic) % 1, (i / plastic**2) % 1


def directions(n: int) -> Tensor:
    """Unit vectors [N, 3], evenly spread."""
    s, t = evenly_spread(n)
    z, angle = 2 * s - 1, 2 * math.pi * t
    radius = (1 - z**2).sqrt()
    return torch.stack([radius * angle.cos(), radius * angle.sin(), z], 1)


def sphere(n: int) -> tuple[Tensor, Tensor]:
    """Points and normals [N, 3] of the inner sphere."""
    d = directions(n)
    return INNER * d, d


def wavy_sphere(n: int) -> tuple[Tensor, Tensor]:
    """Points and normals [N, 3] of the outer sphere, r(d) = 1 + WAVE/3 sum_k sin(9 d_k)."""
    d = directions(n)
    r = 1 + WAVE / 3 * (9 * d).sin().sum(1, keepdim=True)
    slope = 3 * WAVE * (9 * d).cos()
    tangential = slope - (slope * d).sum(1, keepdim=True) * d
    return r * d, normalize(d - tangential / r, dim=1)


def torus(n: int) -> tuple[Tensor, Tensor]:
    """Points and normals [N, 3] of the torus, even by area (the tube's angle solves Kepler's equation)."""
    s, t = evenly_spread(n)
    around, target = 2 * math.pi * s, 2 * math.pi * t
    tube = target.clone()
    for _ in range(20):  # area up to `tube` is proportional to tube + TUBE/RING sin(tube)
        tube = target - TUBE / RING * tube.sin()
    out = torch.stack([around.cos(), torch.zeros_like(s), around.sin()], 1)
    normals = tube.cos()[:, None] * out
    normals[:, 1] = tube.sin()
    return RING * out + TUBE * normals, normals


def facing(normals: Tensor, angle: Tensor) -> Tensor:
    """Quaternions [N, 4] of surfels with these unit normals [N, 3], turned about them by an angle [N]."""
    helper = torch.zeros_like(normals).scatter(1, normals.abs().argmin(1, keepdim=True), 1.0)
    first = normalize(torch.linalg.cross(normals, helper), dim=1)
    second = torch.linalg.cross(normals, first)
    tangent = angle.cos()[:, None] * first + angle.sin()[:, None] * second
    axes = torch.stack([tangent, torch.linalg.cross(normals, tangent), normals], 2)
    return rotation_matrix_to_quaternion(axes)
