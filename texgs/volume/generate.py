"""Volumes made here, for examples and tests: a sphere, an orbital, decaying turbulence, and jets.

All are cubes of float32 in [0, 1] with spacing 1, and the same everywhere for the same arguments up to
rounding. Turbulence and jets are one flow for each seed, whatever the size they are sampled at.
"""

from __future__ import annotations

from collections.abc import Callable
from math import pi

import numpy as np
import torch
from torch import Tensor

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Grid
from texgs.volume.navier_stokes import (
    curl,
    energy,
    evolve,
    project,
    sample,
    to_field,
    to_spectrum,
    wavevectors,
)
from texgs.volume.orbital import orbital_cube

SMALLEST = 16  # samples along each side
TURBULENCE_RESOLUTION, JETS_RESOLUTION = 64, 48  # cells of the simulation along each side; even
NOISE_RESOLUTION = 16  # of the random initial motion


def sphere(size: int) -> Grid:
    """A ball that fades outwards: 1 at the centre, falling smoothly (cosine) to 0 where it meets the faces.

    With a transfer function that is opaque at high values and faint at low ones it is the paper's synthetic
    sphere: an opaque centre in a low-opacity shell.

    Args:
        size: samples along each side, at least 16.

    Raises:
        ArgumentError: if `size` is too small.
    """
    _check_size(size)
    axis = torch.linspace(-1, 1, size)
    distance = (axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2).sqrt()
    return _grid(0.5 + 0.5 * torch.cos(pi * distance.clamp_max(1)))


def orbital(size: int, n: int = 4, degree: int = 3, order: int = 0) -> Grid:
    """Wave function of the electron of a hydrogen atom: 0.5 where it is 0, on either side where it is not.

    By default 4f z^3: along +y a lobe and a ring, both positive, and their mirror image, negative.

    Args:
        size: samples along each side, at least 16.
        n: principal quantum number.
        degree: quantum number l.
        order: quantum number m.
    """
    _check_size(size)
    return _grid(torch.from_numpy(0.5 + 0.5 * orbital_cube(size, n, degree, order)))


def turbulence(size: int, seed: int = 0, duration: float = 1.5, viscosity: float = 0.01) -> Grid:
    """Vorticity magnitude of decaying turbulence in a periodic box: thin, bright vortex tubes.

    A direct numerical simulation from random solenoidal motion; see `navier_stokes.evolve`. Divided by the
    largest magnitude.

    Args:
        size: samples along each side, at least 16.
        seed: of the initial motion.
        duration: simulated time; an eddy turns over in about 1. Tubes have formed by 1, then they decay.
        viscosity: kinematic, for a box 2 pi wide and an initial speed of 1 (root mean square, per axis).
    """
    _check_size(size)
    if not (duration >= 0 and viscosity > 0):
        raise ArgumentError(
            f"turbulence: expected a duration of at least 0 and a viscosity above 0, got {duration} and "
            f"{viscosity}"
        )
    (velocity,) = evolve(random_flow(TURBULENCE_RESOLUTION, 1.5, 2.5, seed), viscosity, [duration])
    vorticity = curl(velocity)
    place = _places(size)
    squared = torch.zeros(size, size, size)
    for component in vorticity:
        squared += sample(component, place, place, place).square()
    largest = torch.linalg.vector_norm(to_field(vorticity), dim=0).max()
    return _grid(squared.sqrt() / largest)


def jets(size: int, seed: int = 0) -> Grid:
    """Upward velocity of five jets that enter through the floor, roll up and break into puffs.

    A stand-in for the five jets data set, not the data. The jets are simulated as they develop in time,
    moving along with their shear layers; height stands for time (Taylor's hypothesis).

    Args:
        size: samples along each side, at least 16.
        seed: of the disturbance that breaks the jets.
    """
    _check_size(size)
    n_frames, speed = 48, 0.5  # snapshots; speed at which the shear layers rise
    frame_of_row = torch.linspace(0, n_frames - 1, size)
    times = [2 * pi / speed * index / (n_frames - 1) for index in range(n_frames)]
    place = _places(size)
    scalar = torch.zeros(size, size, size)
    start = _five_jets(JETS_RESOLUTION) + random_flow(JETS_RESOLUTION, 0.003, 4.0, seed)
    for index, velocity in enumerate(evolve(start, 0.002, times)):
        weight = (1 - (frame_of_row - index).abs()).clamp_min(0)  # linear between snapshots
        rows = weight.nonzero()[:, 0]
        upward = speed + sample(velocity[1], place, place[rows], place)
        scalar[:, rows] += weight[rows, None] * upward
    return _grid(scalar)


def random_flow(size: int, mean_energy: float, peak: float, seed: int) -> Tensor:
    """Spectrum [3, size, size, size // 2 + 1], complex64, of random motion without divergence.

    Energy per wavenumber follows k^4 exp(-2 (k / peak)^2), with nothing at k >= 8, so the motion does not
    depend on `size`.

    Args:
        size: even, at least 16.
        mean_energy: mean of |v|^2 / 2.
        peak: wavenumber with the most energy.
        seed: of the random numbers.
    """
    noise = np.random.default_rng(seed).standard_normal((3, *[NOISE_RESOLUTION] * 3))
    flow = to_spectrum(torch.from_numpy(noise))
    k = torch.linalg.vector_norm(wavevectors(flow), dim=0)
    flow = project(flow) * k * torch.exp(-((k / peak) ** 2)) * (k < NOISE_RESOLUTION / 2)
    flow *= (mean_energy / energy(flow)) ** 0.5
    place = _places(size).double()
    return to_spectrum(sample(flow, place, place, place).float())


def _five_jets(n: int) -> Tensor:
    """Spectrum of round jets of speed 1 along +y, one in the middle, seen at half their speed."""
    radius, thickness, offset = 0.5, 0.11, 1.75
    z, x = torch.meshgrid(_places(n) - pi, _places(n) - pi, indexing="ij")
    corners = [(0.0, 0.0), *((i * offset, j * offset) for i in (-1, 1) for j in (-1, 1))]
    profile = sum(
        (torch.sigmoid(2 * (radius - torch.hypot(x - i, z - j)) / thickness) for i, j in corners),
        start=torch.zeros(()),
    )
    velocity = torch.zeros(3, n, n, n)
    velocity[1] = profile[:, None, :] - 0.5
    return to_spectrum(velocity)


def _places(size: int) -> Tensor:
    """Where the samples of a periodic box lie along one axis, [size]."""
    return 2 * pi / size * torch.arange(size)


def _check_size(size: int) -> None:
    if size < SMALLEST:
        raise ArgumentError(f"size: expected at least {SMALLEST} samples along each side, got {size}")


def _grid(values: Tensor) -> Grid:
    return Grid(values.float().clamp(0, 1).numpy())


GENERATORS: dict[str, Callable[..., Grid]] = {
    "sphere": sphere,
    "orbital": orbital,
    "turbulence": turbulence,
    "jets": jets,
}
RANDOM = ("turbulence", "jets")  # those that a seed changes
