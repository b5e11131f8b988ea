"""The canvas of filters: pixels as points on surfaces, and noise in space.

Noise comes without tables: the same point has the same value in every view and on every device.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import product
from math import log2

import torch
from torch import Tensor

from texgs.models.guidance import EditViews

CELLS = 26.0  # patterns along the longest side of the scene
KEY_LIGHT = (-0.45, 0.75, 0.48)  # direction of the light for the tone of drawings, fixed in the world
SOLID_ALPHA = 0.02  # least alpha of a pixel to paint
WHITE_QUANTILE = 0.95  # quantile of luminance that counts as white
MAX_SORTED_PIXELS = 2**24  # largest input of torch.quantile; larger images are sampled
PRIMES = (73856093, 19349663, 83492791)  # of the usual hash of cells (Teschner et al. 2003)


@dataclass(frozen=True, eq=False)
class Surface:
    """P points. All is fixed to the world, so that views agree on what is painted where."""

    color: Tensor  # [P, 3] straight colours in [0, 1]
    tone: Tensor  # [P] in [0, 1], how light a drawing should be here
    shade: Tensor  # [P] in [0, 1], light of the key light alone
    points: Tensor  # [P, 3] in units of the pattern
    normals: Tensor  # [P, 3] unit length
    pixel: float  # side of a pixel in units of the pattern: edges are as soft as that

    def ramp(self, distance: Tensor) -> Tensor:
        """Return 1 inside, where a signed distance in units of the pattern is negative, 0 outside, softly."""
        return (0.5 - distance / max(self.pixel, 1e-6)).clamp(0, 1)


def surface_of(views: EditViews) -> tuple[Surface, Tensor]:
    """Return the points that views show, and where they are [V, H, W]."""
    where = views.alphas > SOLID_ALPHA
    alpha = views.alphas[where][:, None]
    color = ((views.images[where] - (1 - alpha)) / alpha).clamp(0, 1)
    points, normals = views.points[where], views.normals[where]
    normals = normals / normals.norm(dim=1, keepdim=True).clamp_min(1e-6)
    unit = _side(points) / CELLS
    shade = 0.5 + 0.5 * (normals @ normals.new_tensor(KEY_LIGHT))
    luma = luminance(color)
    some = luma[:: 1 + len(luma) // MAX_SORTED_PIXELS]
    white = some.quantile(WHITE_QUANTILE).clamp_min(1e-3) if len(some) else luma.new_ones(())
    tone = shade * (luma / white).clamp(0, 1)
    pixel = _pixel(views, points) / unit
    return Surface(color, tone, shade.clamp(0, 1), points / unit, normals, pixel), where


def luminance(colors: Tensor) -> Tensor:
    """Return the luminance [P] of colours [P, 3]."""
    from kornia.color import rgb_to_grayscale

    grey: Tensor = rgb_to_grayscale(colors.T[..., None])[0, :, 0]
    return grey


def _side(points: Tensor) -> float:
    """Return the approximate longest side of the visible scene, world units; a power of sqrt 2, so stable."""
    side = float((points.amax(dim=0) - points.amin(dim=0)).max()) if len(points) else 1.0
    return float(2 ** (round(2 * log2(max(side, 1e-6))) / 2))


def _pixel(views: EditViews, points: Tensor) -> float:
    """Return the side of a pixel at the middle of the scene, world units."""
    if not len(points):
        return 1.0
    middle = points.mean(dim=0)
    return sum(float((c.position - middle).norm() / c.K[0, 0]) for c in views.cameras) / len(views)


def cell_keys(cells: Tensor) -> Tensor:
    """Return keys [...] int32 of integer cells [..., 3] int32, for `cell_hash`."""
    x, y, z = (cells[..., axis] * prime for axis, prime in enumerate(PRIMES))
    return x ^ y ^ z


def cell_hash(keys: Tensor, seed: int) -> Tensor:
    """Hash keys [...] of cells to pseudo-random uniform numbers [...] in [0, 1)."""
    h = keys ^ ((seed * 2654435761 + 2**31) % 2**32 - 2**31)
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B - 2**32)):  # a finaliser that mixes all 32 bits
        h = (h ^ _shifted(h, shift)) * factor
    return _shifted(h ^ _shifted(h, 16), 8).to(torch.float32) / 2**24


def _shifted(bits: Tensor, count: int) -> Tensor:
    """Shift 32 bits to the right, filling with zeros."""
    return (bits >> count) & (2 ** (32 - count) - 1)


def value_noise(points: Tensor, seed: int) -> Tensor:
    """Return smooth noise [P] in [0, 1] at points [P, 3]; features are one unit wide."""
    low = points.floor()
    t = points - low
    t = t * t * (3 - 2 * t)
    cells = low.int()
    total = torch.zeros_like(points[:, 0])
    for corner in product((0, 1), repeat=3):
        at = torch.tensor(corner, device=points.device, dtype=torch.int32)
        weight = torch.where(at.bool(), t, 1 - t).prod(dim=1)
        total += weight * cell_hash(cell_keys(cells + at), seed)
    return total


def fractal_noise(points: Tensor, seed: int, octaves: int = 4) -> Tensor:
    """Return noise [P] in [0, 1], about, with finer and finer detail; the coarsest is one unit wide."""
    total, weight, weights = torch.zeros_like(points[:, 0]), 1.0, 0.0
    for octave in range(octaves):
        total += weight * value_noise(points * 2**octave + 17.3 * octave, seed + octave)
        weights, weight = weights + weight, 0.5 * weight
    return total / weights


def neighbours(points: Tensor, seed: int, jitter: float = 0.9) -> Iterator[tuple[Tensor, Tensor]]:
    """Yield vectors from a random centre to points [P, 3], and keys of its cells, for the 27 cells around."""
    low = points.floor()
    for corner in product((-1, 0, 1), repeat=3):
        cells = low.int() + torch.tensor(corner, device=points.device, dtype=torch.int32)
        keys = cell_keys(cells)
        shift = torch.stack([cell_hash(keys, seed + 101 * axis) for axis in (1, 2, 3)], dim=1)
        centre = cells + 0.5 + jitter * (shift - 0.5)
        yield points - centre, keys


def tangential(vectors: Tensor, normals: Tensor, flat: float) -> Tensor:
    """Return vectors [P, 3] with what is along the normals scaled by `flat`: spheres become columns."""
    along = (vectors * normals).sum(dim=1, keepdim=True)
    return vectors - (1 - flat) * along * normals
