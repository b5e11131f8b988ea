"""Where 3D Gaussians start: as surfels do, as thick as they are wide."""

from __future__ import annotations

from dataclasses import asdict

import torch
from torch import Tensor

from texgs.config.phase import Seeds
from texgs.fields.harmonics import split, zeroth
from texgs.fit.seeds import seed_surfels
from texgs.volume.images import Images
from texgs.volume.view_set import ViewSet


def seed_gaussians(images: Images, views: ViewSet, seeds: Seeds, degree: int, seed: int) -> dict[str, Tensor]:
    """Raw parameters of the first Gaussians; `sh` is apart from `sh_rest`, as they learn at different rates.

    Args:
        images: training views.
        views: the same with their folder and metadata.
        seeds: where; "voxels" needs a volume and is refused.
        degree: of the spherical harmonics, those above the zeroth being zero.
        seed: of random numbers.

    Raises:
        ArgumentError: as `seed_surfels`.
    """
    surfels, colors = seed_surfels(images, views, **asdict(seeds), seed=seed)
    thickness = surfels["scales"].amin(dim=1, keepdim=True)  # seeds of surfels are round, or nearly so
    zeros = torch.zeros(len(colors), (degree + 1) ** 2 - 1, 3)
    sh = torch.cat([zeroth(colors), zeros], dim=1)
    return {**surfels, "scales": torch.cat([surfels["scales"], thickness], dim=1), **split(sh)}
