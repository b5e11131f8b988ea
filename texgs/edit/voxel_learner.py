"""A voxel grid that learns from patches of views: what Instruct-NeRF2NeRF does between edits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import torch

from texgs.edit.closeness import Closeness, differentiated
from texgs.fields.voxels.model import Voxels
from texgs.raster.voxel_optimizer import VoxelOptimizer, VoxelRates, add_variation_of_some
from texgs.raster.voxels import Rays, Samples, camera_rays
from texgs.volume.images import Box, Images

if TYPE_CHECKING:
    from texgs.edit.methods.in2n import In2nKeys

TV_DENSITY, TV_SH = 1e-5, 1e-3  # weights of total variation of densities and of spherical harmonics
OCCUPY_EVERY = 50  # iterations between looks at which cells show anything, where densities learn


class VoxelLearner:
    """A grid with RMSProp.

    Args:
        field: to start from; it stays as it is.
        keys: rates and patches.
        closeness: loss on patches, without D-SSIM.
    """

    def __init__(self, field: Voxels, keys: In2nKeys, closeness: Closeness) -> None:
        self.original, self.keys, self.closeness = field, keys, closeness
        self.density = 0.0 if keys.frozen else keys.density
        self.grid = field.grid.with_rows(field.grid.rows.clone())
        self.optimizer = VoxelOptimizer(self.grid)
        self.iteration = 0

    @property
    def field(self) -> Voxels:
        """As it is now."""
        self.grid.refresh_occupancy()
        return replace(self.original, grid=self.grid)

    @torch.no_grad()
    def step(self, images: Images, views: Sequence[int], generator: torch.Generator) -> float:
        """Learn from patches of these views, drawn at random around what is visible; the loss."""
        keys, size = self.keys, images.size
        side = min(keys.side, *size)
        rays, wanted = [], []
        for place in torch.randint(len(views), (keys.patches,), generator=generator).tolist():
            left, top = corner(images.boxes[views[place]], side, size, generator)
            camera = images.cameras[views[place]].crop(left, top, left + side, top + side)
            rays.append(camera_rays(camera).flatten(0, 1))
            wanted.append(images.planes[views[place], :3, top : top + side, left : left + side])
        drawn = torch.cat(rays)
        out = Rays(drawn.new_empty(len(drawn), 3), *drawn.new_empty(2, len(drawn)))
        samples = Samples(self.grid, self.original.march, drawn, out)
        shape = (keys.patches, side, side, 3)
        target = torch.stack(wanted).permute(0, 2, 3, 1).float() / 255
        with torch.enable_grad():
            loss, gradient = differentiated(self.closeness, out.color.reshape(shape), target)
        samples.add_gradient(gradient.reshape(-1, 3), None, self.optimizer.gradient)
        self._update(generator)
        return loss

    def _update(self, generator: torch.Generator) -> None:
        """A step of RMSProp, with total variation of some random blocks."""
        weight = TV_DENSITY if self.density else 0.0
        add_variation_of_some(self.grid, weight, TV_SH, generator, self.optimizer.gradient)
        self.optimizer.step(VoxelRates(self.density, self.keys.sh, self.keys.sh))
        self.iteration += 1
        if self.density and self.iteration % OCCUPY_EVERY == 0:
            self.grid.refresh_occupancy()


def corner(box: Box, side: int, size: tuple[int, int], generator: torch.Generator) -> tuple[int, int]:
    """Left and top of a patch inside of an image, its middle drawn from a box.

    Args:
        box: around what is visible.
        side: of the patch, pixels.
        size: width and height of the image.
        generator: that draws.
    """
    low, high = torch.tensor(box[:2]), torch.tensor(box[2:])
    middle = low + (torch.rand(2, generator=generator) * (high - low)).long()
    left, top = (middle - side // 2).clamp_min(0).minimum(torch.tensor(size) - side).tolist()
    return left, top
