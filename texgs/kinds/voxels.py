"""Sparse grids of voxels (Plenoxels): what ARF and Instruct-NeRF2NeRF stand on."""

from __future__ import annotations

import time
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
    """Fit a grid to random rays, coarse to fine.

    Raises:
        DeviceError: for another device than the CPU.
    """
    from texgs.core.progress import progress
    from texgs.fields.voxels.model import Voxels
    from texgs.fit.task import Fitted
    from texgs.fit.voxels import VoxelFit

    if task.device.type != "cpu":
        raise DeviceError(f"device: expected cpu, got {task.device}; voxels are fitted on the CPU")
    start = time.monotonic()
    run, losses = VoxelFit(task.images, task.settings, task.seed), []
    for done in progress(run.run(), task.settings.steps, title=task.title, unit="step"):
        losses += [] if done.loss is None else [done.loss]
    field = Voxels(run.grid, run.march)
    notes = {"lattice": list(run.grid.size)}
    return Fitted(field, time.monotonic() - start, task.settings.steps, losses, notes)


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
)
