"""Files of voxel grids: masks and values as safetensors, the lattice as JSON in the header."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ShapeError, located
from texgs.core.io import reading_as
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.voxels.model import Voxels
from texgs.raster.voxel_grid import VoxelGrid, lattice_of, pack_rows, unpack_rows, unpacked, voxel_grid
from texgs.raster.voxels import March

FORMAT = "texgs-voxels"
VERSION = 1
COEFFICIENTS = {1: 0, 4: 1, 9: 2}  # degrees by number of coefficients


def write_voxels(path: str | Path, field: Voxels) -> Path:
    """Create or replace a file of voxels in one step; its metadata must be JSON."""
    density, sh = unpack_rows(field.grid.rows.detach())
    check.finite(density=density, sh=sh)
    tensors = {"masks": field.grid.masks, "density": density.contiguous(), "sh": sh.contiguous()}
    description = {"version": VERSION, **lattice(field.grid, field.march), "metadata": dict(field.metadata)}
    return write_tensor_file(path, FORMAT, description, tensors)


def read_voxels(path: str | Path) -> Voxels:
    """Read a file of voxels as `write_voxels` writes it, bit for bit. Nothing in it is executed."""
    description, tensors = read_tensor_file(Path(path), FORMAT, VERSION)
    with located(path), reading_as("a grid and its lattice", "write it again"):
        check.finite(density=tensors["density"], sh=tensors["sh"])
        return Voxels(grid_of(tensors, description), march_of(description), dict(description["metadata"]))


def lattice(grid: VoxelGrid, march: March) -> dict[str, Any]:
    """Describe where a grid lies, and how rays go through it."""
    marched = {"step": march.step, "transmittance_min": march.transmittance_min}
    return {"lower": grid.lower, "spacing": grid.spacing, **marched}


def march_of(description: Mapping[str, Any]) -> March:
    """Return how rays go through a grid, from what `lattice` returned."""
    return March(step=float(description["step"]), transmittance_min=float(description["transmittance_min"]))


def grid_of(tensors: Mapping[str, Tensor], description: Mapping[str, Any]) -> VoxelGrid:
    """Make a grid of masks, densities and coefficients, and of a lattice."""
    masks, density, sh = (tensors[name] for name in ("masks", "density", "sh"))
    check.shape("masks", masks, "X Y Z")
    n = check.shape("density", density, "N")["N"]
    if (count := check.shape("sh", sh, "N K 3", N=n)["K"]) not in COEFFICIENTS:
        raise ShapeError(f"sh: expected 1, 4 or 9 coefficients, [N, K, 3], got {count}")
    if masks.dtype != torch.int64 or density.dtype != torch.float32 or sh.dtype != torch.float32:
        raise ShapeError("masks, density, sh: expected int64 and float32, got other types")
    bits = unpacked(masks)
    if int(bits.sum()) + 1 != n:  # the first row is that of all other voxels
        raise ShapeError(f"masks: expected the bits of {n - 1} voxels, got {int(bits.sum())}")
    spacing = float(description["spacing"])
    grid = voxel_grid(lattice_of(bits), description["lower"], spacing, COEFFICIENTS[count])
    return grid.with_rows(pack_rows(density, sh))
