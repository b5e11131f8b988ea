"""Training rays of views near something visible, ordered so that neighbours are close in memory."""

from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.core.geometry import z_order
from texgs.volume.images import Images

MARGIN = 6  # pixels around visible ones; the visual hull keeps all others empty


@dataclass(frozen=True, eq=False)
class TrainingRays:
    """Rays of all views, view by view along a space-filling curve."""

    origins: Tensor  # [V, 3]
    directions: Tensor  # [M, 3]
    views: Tensor  # [M] int16
    colors: Tensor  # [M, 3] uint8 over white

    def __len__(self) -> int:
        return len(self.views)

    def take(self, ids: Tensor) -> tuple[Tensor, Tensor]:
        """Return rays [n, 6] and their colours [n, 3]."""
        origins = self.origins[self.views[ids].long()]
        return torch.cat([origins, self.directions[ids]], dim=1), self.colors[ids].float() / 255

    def draw(self, count: int, run: int, generator: torch.Generator) -> tuple[Tensor, Tensor]:
        """Draw about `count` random rays in runs of neighbours, and their colours."""
        starts = torch.randint(max(len(self) - run, 0) + 1, (count // run,), generator=generator)
        return self.take((starts[:, None] + torch.arange(min(run, len(self)))).flatten())


def training_rays(images: Images) -> TrainingRays:
    """Return rays through the visible pixels of all views, and through their neighbours."""
    width, height = images.size
    order = curve(width, height)
    directions, views, colors = [], [], []
    for index, camera in enumerate(images.cameras):
        planes = images.planes[index].flatten(1)[:, order]  # [4, H W]
        near = widen(images.planes[index, 3], MARGIN).flatten()[order]
        directions.append(camera.rays().reshape(-1, 3)[order[near]])
        colors.append(planes[:3, near].T.contiguous())
        views.append(torch.full((int(near.sum()),), index, dtype=torch.int16))
    if not any(map(len, views)):
        raise ArgumentError("views: expected something visible in one of them, found none; is their alpha 0?")
    origins = torch.stack([camera.position for camera in images.cameras])
    return TrainingRays(origins, torch.cat(directions), torch.cat(views), torch.cat(colors))


def widen(alpha: Tensor, pixels: int) -> Tensor:
    """Dilate the visible pixels of alpha [H, W] uint8 by a number of pixels along both axes."""
    import cv2

    side = 2 * pixels + 1
    return torch.from_numpy(cv2.dilate(alpha.numpy(), np.ones((side, side), np.uint8))) > 0


def curve(width: int, height: int) -> Tensor:
    """Return the places y * width + x of all pixels in the order of a Z curve."""
    y, x = torch.meshgrid(torch.arange(height), torch.arange(width), indexing="ij")
    return z_order(torch.stack([x, y], dim=-1).flatten(0, 1))
