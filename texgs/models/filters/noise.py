"""Noise in space, without tables: the same point has the same value in every view and on every device."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import torch
from torch import Tensor

PRIMES = (73856093, 19349663, 83492791)  # of the usual hash of cells (Teschner et al. 2003)
MASK = 0xFFFFFFFF


def cell_hash(cells: Tensor, seed: int) -> Tensor:
    """Return uniform numbers [...] in [0, 1) of integer cells [..., 3], as if random."""
    x, y, z = (cells[..., axis] * prime for axis, prime in enumerate(PRIMES))
    h = (x ^ y ^ z ^ (seed * 2654435761 & MASK)) & MASK
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):  # a finaliser that mixes all 32 bits
        h = ((h ^ (h >> shift)) * factor) & MASK
    h = h ^ (h >> 16)
    return (h >> 8).to(torch.float32) / 2**24


def value_noise(points: Tensor, seed: int) -> Tensor:
    """Return smooth noise [P] in [0, 1] at points [P, 3]; features are one unit wide."""
    low = points.floor()
    t = points - low
    t = t * t * (3 - 2 * t)
    cells = low.long()
    total = torch.zeros_like(points[:, 0])
    for corner in product((0, 1), repeat=3):
        at = torch.tensor(corner, device=points.device)
        weight = torch.where(at.bool(), t, 1 - t).prod(dim=1)
        total += weight * cell_hash(cells + at, seed)
    return total


def fractal_noise(points: Tensor, seed: int, octaves: int = 4) -> Tensor:
    """Return noise [P] in [0, 1], about, with finer and finer detail; the coarsest is one unit wide."""
    total, weight, weights = torch.zeros_like(points[:, 0]), 1.0, 0.0
    for octave in range(octaves):
        total += weight * value_noise(points * 2**octave + 17.3 * octave, seed + octave)
        weights, weight = weights + weight, 0.5 * weight
    return total / weights


def neighbours(points: Tensor, seed: int, jitter: float = 0.9) -> Iterator[tuple[Tensor, Tensor]]:
    """Yield vectors from a random centre to points [P, 3], and its integer cells, for the 27 cells around."""
    low = points.floor()
    for corner in product((-1, 0, 1), repeat=3):
        cells = low.long() + torch.tensor(corner, device=points.device)
        shift = torch.stack([cell_hash(cells, seed + 101 * axis) for axis in (1, 2, 3)], dim=1)
        centre = cells + 0.5 + jitter * (shift - 0.5)
        yield points - centre, cells


def tangential(vectors: Tensor, normals: Tensor, flat: float) -> Tensor:
    """Return vectors [P, 3] with what is along the normals scaled by `flat`: spheres become columns."""
    along = (vectors * normals).sum(dim=1, keepdim=True)
    return vectors - (1 - flat) * along * normals
