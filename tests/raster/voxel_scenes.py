"""Small voxel grids, and the same as dense lattices for the definition."""

from dataclasses import dataclass, replace

import torch

from texgs.raster.reference import voxels as definition
from texgs.raster.voxel_grid import VoxelGrid, pack_rows, voxel_grid
from texgs.raster.voxels import March

LOWER, SPACING = (-0.7, -0.4, -0.5), 0.1


@dataclass
class VoxelScene:
    """A grid, rays and how they march."""

    grid: VoxelGrid
    density: torch.Tensor  # [n - 1] of the voxels with a row
    sh: torch.Tensor  # [n - 1, k, 3]
    rays: torch.Tensor  # [N, 6]
    march: March

    def to(self, device):
        """The same on another device."""
        rest = {name: getattr(self, name).to(device) for name in ("grid", "density", "sh", "rays")}
        return replace(self, **rest)

    def definition(self, density, sh):
        """Colour, alpha and depth by the definition, in float64."""
        links = self.grid.links().long()
        return definition.render_rays(
            torch.cat([density.new_zeros(1), density])[links],
            torch.cat([sh.new_zeros(1, *sh.shape[1:]), sh])[links],
            LOWER,
            SPACING,
            self.rays.double(),
            self.march.background,
            self.march.step,
            self.march.transmittance_min,
            None if self.march.depth_range is None else self.march.depth_range.double(),
        )


def voxel_scene(seed=0, size=(16, 12, 20), degree=2, n_rays=300, density=12.0, filled=0.5, **march):
    """Random voxels, rays from all sides."""
    generator = torch.Generator().manual_seed(seed)
    mask = torch.rand(size, generator=generator) < filled
    mask[:, :4, 8:] = False  # whole blocks without voxels
    grid = voxel_grid(mask, LOWER, SPACING, degree)
    n = len(grid)
    values = density * (2 * torch.rand(n, generator=generator) - 0.7)
    sh = torch.randn(n, (degree + 1) ** 2, 3, generator=generator)
    empty = torch.zeros(1, grid.rows.shape[1])
    grid = grid.with_rows(torch.cat([empty, pack_rows(values, sh)]))
    return VoxelScene(grid, values, sh, random_rays(size, n_rays, generator), March((0.2, 0.6, 0.9), **march))


def random_rays(size, n, generator):
    """Rays from around a lattice, most of which meet it; some start inside of it and some along an axis."""
    extent = SPACING * torch.tensor(size)
    middle = torch.tensor(LOWER) + extent / 2
    origin = middle + 2 * torch.randn(n, 3, generator=generator)
    aim = middle + extent * (torch.rand(n, 3, generator=generator) - 0.5)
    direction = aim - origin
    origin[: n // 10] = aim[: n // 10]
    direction[n // 10 : n // 5] = torch.eye(3)[torch.randint(3, (n // 5 - n // 10,), generator=generator)]
    origin[n // 10 : n // 5] = aim[n // 10 : n // 5] - 3 * direction[n // 10 : n // 5]
    return torch.cat([origin, direction], dim=1)
