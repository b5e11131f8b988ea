"""The fit of a voxel grid to random rays of views."""

from texgs.fields.kinds.voxels import FIELD
from texgs.fitting.kinds import FitSpec, FitTask, Fitted
from texgs.fitting.ray_settings import VoxelKeys


def fit(task: FitTask[VoxelKeys]) -> Fitted:
    """Fit a grid to random rays, coarse to fine, from the last checkpoint if there is one."""
    from texgs.fields.voxels.model import Voxels
    from texgs.fitting.checkpoint import FOLDER, run_to_end
    from texgs.fitting.voxels import VoxelFit

    run = VoxelFit(task.images, task.settings, task.seed)
    seconds = run_to_end(run, task.output / FOLDER, task.title)
    notes = {"lattice": list(run.grid.size)}
    return Fitted(Voxels(run.grid, run.march, task.metadata), seconds, run.iterations, run.losses, notes)


FIT = FitSpec(
    FIELD,
    "fit a sparse grid of voxels",
    phases=("voxels",),
    settings=VoxelKeys,
    fit=fit,
    check=VoxelKeys.check,
    devices=frozenset({"cpu"}),
)
