"""Depth maps of many views as one surface: the mean signed distance of voxels (Curless and Levoy 1996).

On the CPU; deterministic for any number of threads.
"""

from dataclasses import dataclass

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.raster import native
from texgs.raster.arguments import require

BLOCK = 8  # TEXGS_FUSION_BLOCK
NativeLattice = native.struct("texgs_lattice", "3i shape, 3f lower, f spacing, p distance views color")
NativeView = native.struct("texgs_depth_view", "p viewmat K, i width height, p depth color")
native.declare("texgs_fuse", NativeLattice, "np", NativeView, "f")


@dataclass(frozen=True, eq=False)
class DepthView:
    """The surface in one view; on the CPU."""

    camera: Camera
    depth: Tensor  # [H, W] float32, camera z in world units, 0 where there is no surface
    color: Tensor  # [H, W, 3] uint8

    def __post_init__(self) -> None:
        size = f"{self.camera.height} {self.camera.width}"
        viewmat, K = self.camera.viewmat.float(), self.camera.K.float()
        require({"depth": (self.depth, size), "viewmat": (viewmat, "4 4"), "K": (K, "3 3")}, cpu="move it")
        check.shape("color", self.color, f"{size} 3")
        if self.color.dtype != torch.uint8 or self.color.device.type != "cpu":
            raise ArgumentError(f"color: expected uint8 on cpu, got {self.color.dtype}, {self.color.device}")


class Lattice:
    """Means over the views that saw a voxel, of a box of blocks of 8 x 8 x 8 voxels.

    `distance` [Z, Y, X] is that to the surface in truncations, from -1, behind it, to 1; `views` [Z, Y, X]
    are how many saw a voxel, and `color` [Z, Y, X, 3] is from 0 to 255. `blocks` count along x, y and z;
    `lower` [3] is the place of the first voxel, and `spacing` the distance of voxels, in world units.
    """

    def __init__(self, blocks: tuple[int, int, int], lower: Tensor, spacing: float) -> None:
        self.blocks, self.lower, self.spacing = blocks, lower, spacing
        shape = [BLOCK * n for n in reversed(blocks)]
        self.distance, self.views, self.color = torch.ones(shape), torch.zeros(shape), torch.zeros(*shape, 3)

    def add(self, view: DepthView, blocks: Tensor, truncation: float) -> None:
        """Update the voxels of some blocks, in front of the surface and up to the truncation behind it.

        `blocks` [N, 3] are numbers along x, y and z, each block once; the truncation is in world units.
        """
        check.shape("blocks", blocks, "N 3")
        if blocks.is_floating_point():
            raise ArgumentError(f"blocks: expected whole numbers, got {blocks.dtype}")
        if len(blocks) and not bool(((blocks >= 0) & (blocks < torch.tensor(self.blocks))).all()):
            raise ArgumentError(f"blocks: expected numbers below {self.blocks}, got others")
        if len(blocks.unique(dim=0)) < len(blocks):
            raise ArgumentError("blocks: expected each one once, got some twice")
        chosen = blocks.to(torch.int32).contiguous()
        voxels = tuple(BLOCK * n for n in self.blocks)
        state = (self.distance, self.views, self.color)
        lattice = NativeLattice(voxels, tuple(self.lower.tolist()), self.spacing, *state)
        matrices = [matrix.float().contiguous() for matrix in (view.camera.viewmat, view.camera.K)]
        size = (view.camera.width, view.camera.height)
        seen = NativeView(*matrices, *size, view.depth.contiguous(), view.color.contiguous())
        native.call("texgs_fuse", lattice, len(chosen), chosen, seen, truncation, device=torch.device("cpu"))
