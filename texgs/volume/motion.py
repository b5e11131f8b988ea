"""The motion of visible matter under a transfer function from one volume of a series to the next."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import SimpleITK as sitk
import torch
from torch import Tensor
from torch.nn.functional import grid_sample

from texgs.volume.framing import shown_corners, shown_values
from texgs.volume.grid import Grid
from texgs.volume.label_masks import HALF
from texgs.volume.transfer import TransferFunction

MARGIN = 6  # samples around the visible part
MAX_SIDE = 96  # samples along a side to register; larger volumes are averaged in blocks
LEVELS = ((4, 60), (2, 40), (1, 20))  # samples of a block, and iterations, one level after the other
SMOOTHNESS = 0.7  # standard deviation that displacements are smoothed with after each iteration, blocks
LOW_MARGIN = 0.1  # share of the visible range; values so far below it still guide the registration


@dataclass(frozen=True, eq=False)
class Motion:
    """Displacements on a lattice; between its points they are linear, beyond it those of its faces."""

    displacements: Tensor  # [Z, Y, X, 3] world units, float32
    first: Tensor  # [3] world coordinates x, y, z of the first point of the lattice
    last: Tensor  # [3] of the last one

    def at(self, points: Tensor) -> Tensor:
        """Return the displacements [N, 3] of points [N, 3], world units."""
        relative = 2 * (points - self.first) / (self.last - self.first) - 1
        field = self.displacements.permute(3, 0, 1, 2)[None]
        places = relative.reshape(1, 1, 1, -1, 3)
        moved = grid_sample(field, places, padding_mode="border", align_corners=True)
        return moved[0, :, 0, 0].T


def motion(before: Grid, after: Grid, tf: TransferFunction) -> Motion:
    """Register the visible part of a volume under a function to the next one on the same lattice.

    Values that the function shows are registered by symmetric demons (Vercauteren et al. 2007) from coarse to
    fine, in the box in which either volume shows something. One that shows nothing is refused.
    """
    dims = np.array(before.dims)
    corners = np.concatenate([shown_corners(grid, [tf]) for grid in (before, after)])
    voxel = np.array(before.aabb[1]) * 2 / (dims - 1)
    corners = corners / voxel + (dims - 1) / 2  # in samples
    low = np.maximum(np.floor(corners.min(axis=0)).astype(int) - MARGIN, 0)
    high = np.minimum(np.ceil(corners.max(axis=0)).astype(int) + MARGIN + 1, dims)
    field = register([shown_image(grid, tf, low, high) for grid in (before, after)])
    displacements = torch.from_numpy(sitk.GetArrayFromImage(field) * voxel).float()
    first = np.array(field.GetOrigin())
    last = first + np.array(field.GetSpacing()) * (np.array(field.GetSize()) - 1)
    ends = (torch.from_numpy((end - (dims - 1) / 2) * voxel).float() for end in (first, last))
    return Motion(displacements, *ends)


def register(images: Sequence[sitk.Image]) -> sitk.Image:
    """Return displacements in samples from the first image to the second one, from coarse to fine."""
    start: list[sitk.Image] = []
    for block, iterations in LEVELS:
        blocks = [max(1, min(block, size // 2)) for size in images[0].GetSize()]  # two at least of a side
        fixed, moving = (sitk.BinShrink(image, blocks) for image in images)
        demons = sitk.FastSymmetricForcesDemonsRegistrationFilter()
        demons.SetNumberOfIterations(iterations)
        demons.SetStandardDeviations(SMOOTHNESS)
        beyond = (0.0, sitk.sitkVectorFloat64, True)  # the lattice displacements are those of its faces
        start = [sitk.Resample(each, fixed, sitk.Transform(), sitk.sitkLinear, *beyond) for each in start]
        start = [demons.Execute(fixed, moving, *start)]
    return start[0]


def shown_image(grid: Grid, tf: TransferFunction, low: np.ndarray, high: np.ndarray) -> sitk.Image:
    """Return the values of a box, relative to a function's visible range, on a lattice in samples."""
    ranges = shown_values(tf)
    least, most = float(ranges[0][0]), float(ranges[-1][1])
    box = tuple(slice(*ends) for ends in zip(low[::-1], high[::-1], strict=True))
    shown = grid.channel(tf.channel).values[box].astype(np.float32)
    if tf.within is not None:
        shown[grid.channel(tf.within).values[box] < HALF] = np.nan
    values = np.nan_to_num(shown, nan=least, posinf=most, neginf=least)
    image = sitk.GetImageFromArray(((values - least) / (most - least)).clip(-LOW_MARGIN, 1))
    image.SetOrigin(low.astype(float).tolist())
    blocks = [-(-size // MAX_SIDE) for size in image.GetSize()]
    return sitk.BinShrink(image, blocks)
