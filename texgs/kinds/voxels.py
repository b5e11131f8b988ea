"""Sparse grids of voxels (Plenoxels): what ARF and Instruct-NeRF2NeRF build on."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.config.fields import Kind
from texgs.config.voxel_fit import VoxelKeys
from texgs.core.errors import DeviceError

if TYPE_CHECKING:
    from torch import Tensor

    from texgs.fields.voxels.composition import VoxelScene
    from texgs.fields.voxels.model import Voxels
    from texgs.fit.task import FitTask, Fitted


def read(path: Path) -> Voxels:
    """The grid in a file."""
    from texgs.fields.voxels.file import read_voxels

    return read_voxels(path)


def write(path: Path, field: Voxels) -> Path:
    """Write a grid without loss."""
    from texgs.fields.voxels.file import write_voxels

    return write_voxels(path, field)


def compose(fields: Sequence[Voxels], segments: Sequence[Sequence[Tensor]]) -> VoxelScene:
    """Grids as one scene."""
    from texgs.fields.voxels.composition import VoxelScene

    return VoxelScene(fields)


def fit(task: FitTask[VoxelKeys]) -> Fitted:
    """Fit a grid to random rays, coarse to fine, from the last checkpoint if there is one.

    Raises:
        DeviceError: for another device than the CPU.
    """
    from texgs.fields.voxels.model import Voxels
    from texgs.fit import checkpoint
    from texgs.fit.resumable import run_to_end
    from texgs.fit.task import Fitted
    from texgs.fit.voxels import VoxelFit

    if task.device.type != "cpu":
        raise DeviceError(f"device: expected cpu, got {task.device}; voxels are fitted on the CPU")
    run = VoxelFit(task.images, task.settings, task.seed)
    seconds = run_to_end(run, task.output / checkpoint.FOLDER, task.title)
    notes = {"lattice": list(run.grid.size)}
    return Fitted(Voxels(run.grid, run.march, task.metadata), seconds, run.iterations, run.losses, notes)


FIELD = Kind(
    "voxels",
    "fit a sparse grid of voxels",
    ("texgs-voxels",),
    frozenset({"opacity"}),
    read,
    write,
    compose,
    phases=("voxels",),
    settings=VoxelKeys,
    fit=fit,
    check=VoxelKeys.check,
    exports=("mesh",),
    depth="depth",  # the mean
    devices=frozenset({"cpu"}),
)
