"""Files of voxel grids: masks and values as safetensors, the lattice as JSON in the header."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError, ShapeError, TexgsError
from texgs.core.tensor_file import read_tensor_file, write_tensor_file
from texgs.fields.voxels.model import Voxels
from texgs.raster.voxel_grid import VoxelGrid, pack_rows, unpack_rows, voxel_grid
from texgs.raster.voxels import March

FORMAT = "texgs-voxels"
VERSION = 1
BITS = torch.arange(64)


def write_voxels(path: str | Path, field: Voxels) -> Path:
    """Create or replace a file of voxels in one step; the same grid gives the same bytes.

    Args:
        path: target.
        field: to write. Its metadata must be JSON.
    """
    grid = field.grid
    density, sh = unpack_rows(grid.rows.detach())
    tensors = {"masks": grid.masks, "density": density.contiguous(), "sh": sh.contiguous()}
    _require_finite(tensors)
    description = {
        "version": VERSION,
        "lower": grid.lower,
        "spacing": grid.spacing,
        "step": field.march.step,
        "transmittance_min": field.march.transmittance_min,
        "metadata": dict(field.metadata),
    }
    return write_tensor_file(path, FORMAT, description, tensors)


def read_voxels(path: str | Path) -> Voxels:
    """Read a file of voxels as `write_voxels` writes it, bit for bit. Nothing in it is executed."""
    path = Path(path)
    description, tensors = read_tensor_file(path, FORMAT, VERSION)
    try:
        _require_finite(tensors)
        march = March(
            step=float(description["step"]), transmittance_min=float(description["transmittance_min"])
        )
        return Voxels(grid_of(tensors, description), march, dict(description["metadata"]))
    except TexgsError as error:
        raise type(error)(f"{path}: {error}") from error
    except (KeyError, TypeError, ValueError) as error:
        raise ArgumentError(f"{path}: expected a grid and its lattice, got others; write it again") from error


def grid_of(tensors: Mapping[str, Tensor], description: Mapping[str, Any]) -> VoxelGrid:
    """The grid of masks, densities and coefficients, and of a lattice."""
    masks, density, sh = (tensors[name] for name in ("masks", "density", "sh"))
    check.shape("masks", masks, "X Y Z")
    n = check.shape("density", density, "N")["N"]
    degree = {1: 0, 4: 1, 9: 2}[check.shape("sh", sh, "N K 3", N=n)["K"]]
    if masks.dtype != torch.int64 or density.dtype != torch.float32 or sh.dtype != torch.float32:
        raise ShapeError("masks, density, sh: expected int64 and float32, got other types")
    x, y, z = masks.shape
    bits = (masks[..., None] >> BITS & 1).bool()
    if int(bits.sum()) + 1 != n:  # the first row is that of all other voxels
        raise ShapeError(f"masks: expected the bits of {n - 1} voxels, got {int(bits.sum())}")
    lattice = bits.reshape(x, y, z, 4, 4, 4).permute(0, 3, 1, 4, 2, 5).reshape(4 * x, 4 * y, 4 * z)
    grid = voxel_grid(lattice, description["lower"], float(description["spacing"]), degree)
    return grid.with_rows(pack_rows(density, sh))


def _require_finite(tensors: dict[str, Tensor]) -> None:
    check.finite(**{name: x for name, x in tensors.items() if x.is_floating_point()})
