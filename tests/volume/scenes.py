"""Volumes with closed forms, and pictures over white."""

from collections.abc import Iterator

import numpy as np
import torch

from texgs.core.camera import Camera, intrinsics, look_at
from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction

# Half transparent outside, opaque inside, two colours: of `ball`, whose values fall from 1 at the centre.
SHELLS = TransferFunction(((0.3, 0.0), (0.5, 0.3), (0.8, 0.6)), ((0.3, 0.8, 0.4, 0.2), (0.6, 0.1, 0.2, 0.9)))

SPECK = TransferFunction(((0.5, 0.0), (1, 1.0)), ((0, 1, 1, 1),))  # of `specks`


def lattice(x: int, y: int, z: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates x, y, z [Z, Y, X] in [-1, 1], float32."""
    axes = [np.linspace(-1, 1, size, dtype=np.float32) for size in (z, y, x)]
    Z, Y, X = np.meshgrid(*axes, indexing="ij")
    return X, Y, Z


def ball(size: int = 48) -> Grid:
    """1 - distance from the centre: its level sets are spheres."""
    x, y, z = lattice(size, size, size)
    return Grid(1 - np.sqrt(x * x + y * y + z * z))


def constant(tf_opacity: float, color: tuple[float, float, float] = (0.8, 0.4, 0.2)) -> TransferFunction:
    """One opacity and one colour for every value that the volumes here have."""
    return TransferFunction(((-10.0, tf_opacity), (10.0, tf_opacity)), ((-10.0, *color),))


def specks() -> Iterator[tuple[Grid, Camera, float]]:
    """Volumes with one sample that is not empty, cameras that look at it, and its camera z; see SPECK."""
    rng = np.random.default_rng(0)
    for x, y, z in [(0, 0, 0), (21, 16, 0), *rng.integers(0, (22, 17, 18), (12, 3))]:
        values = np.zeros((18, 17, 22), np.float32)
        values[z, y, x] = 1
        grid = Grid(values, (1.0, 0.7, 1.3))
        place = torch.tensor(np.array(grid.aabb[0]) + np.array(grid.spacing) * grid.scale * (x, y, z))
        viewmat = look_at(torch.tensor([0.1, 0.1, 3.0], dtype=torch.float64), place).float()
        depth = float(viewmat[2, :3] @ place.float() + viewmat[2, 3])
        yield grid, Camera(viewmat, intrinsics(2, 5, 5), 5, 5), depth


def over_white(rgba: np.ndarray) -> np.ndarray:
    """Premultiplied RGBA [H, W, 4] in front of white, [H, W, 3]."""
    return rgba[..., :3] + 1 - rgba[..., 3:]


def psnr(one: np.ndarray, other: np.ndarray) -> float:
    """Decibels, of values in [0, 1]; 200 for equal arrays."""
    return -10 * float(np.log10(np.mean((np.float64(one) - other) ** 2) + 1e-20))
