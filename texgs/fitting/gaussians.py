"""The fit of 3D Gaussians: one phase of the same loop as for surfels."""

import torch
from torch import Tensor

from texgs.fields.gaussians import Baked, Gaussians
from texgs.fields.splats import join, split, zeroth
from texgs.fitting.checkpoint import FOLDER, run_to_end
from texgs.fitting.loop import Fit
from texgs.fitting.seeds import seed_surfels
from texgs.fitting.settings import GaussianKeys, Seeds
from texgs.fitting.task import FitTask, Fitted
from texgs.volume.grid import Grid
from texgs.volume.images import Images
from texgs.volume.view_set import ViewSet


def fit_gaussians(task: FitTask[GaussianKeys]) -> Fitted:
    """Fit Gaussians to the views, from the last checkpoint if any."""
    keys = task.settings
    most = keys.densify.cap
    start = seed_gaussians(task.images, task.views, keys.seeds, keys.sh_degree, task.seed, task.volume, most)
    shading = Baked(keys.antialiased)
    on_device = {name: x.to(task.device) for name, x in start.items()}
    run = Fit(on_device, shading, task.images, keys.phase, task.seed)
    seconds = run_to_end(run, task.output / FOLDER, task.title)
    field = Gaussians(join(run.result), shading, task.metadata)
    return Fitted(field, seconds, run.iterations, run.losses)


def seed_gaussians(
    images: Images,
    views: ViewSet,
    seeds: Seeds,
    degree: int,
    seed: int,
    volume: Grid | None = None,
    most: int | None = None,
) -> dict[str, Tensor]:
    """Return raw start parameters of Gaussians: like those of surfels, and as thick as wide.

    `sh` is apart from `sh_rest`, as they learn at different rates; all but the zeroth harmonic are zero.
    """
    surfels, colors = seed_surfels(images, views, seeds, seed, volume, most)
    thickness = surfels["scales"].amin(dim=1, keepdim=True)  # seeds of surfels are round, or nearly so
    zeros = torch.zeros(len(colors), (degree + 1) ** 2 - 1, 3)
    sh = torch.cat([zeroth(colors), zeros], dim=1)
    return {**surfels, "scales": torch.cat([surfels["scales"], thickness], dim=1), **split(sh)}
