"""Volumes that are computed, for examples and tests; rings and a flame change in time.

All are cubes of float32 in [0, 1] with spacing 1, and the same everywhere for the same arguments up to
rounding. Turbulence and jets are one flow for each seed, whatever the size they are sampled at. Rings and
flame are formulas, so that a moment costs no more than its samples; their time goes from 0 to 1.
"""

from collections.abc import Callable
from math import cos, factorial, pi, sin, sqrt

import numpy as np
import torch
from scipy.special import eval_genlaguerre, lpmv
from torch import Tensor

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

Array = np.ndarray
ORBITAL = (4, 3, 0)  # quantum numbers n, l and m: 4f z^3
AMPLITUDE_CUTOFF = 0.05  # share of the largest amplitude along the radius of an orbital; the rest is cut off
STEPS = 4096  # along the radius and the polar angle, to search for the largest amplitude
TURBULENCE_RESOLUTION, JETS_RESOLUTION = 64, 48  # cells of the simulation along each side; even
DURATION = 1.5  # of turbulence; an eddy turns over in about 1. Tubes have formed by 1, then they decay
VISCOSITY = 0.01  # of turbulence, for a box 2 pi wide and an initial speed of 1 (root mean square, per axis)
NOISE_RESOLUTION = 16  # cells of the random initial motion along each side
RADIUS, CORE = 0.42, 0.11  # of rings and of their cores, half sides of the cube
TURN = (0.14, 0.2)  # half axes of the ellipse on which the rings turn about each other: radius and height
CLIMB = 0.5  # of both, in a series
WAVES, CREST = (4, 7), 0.05  # around the first ring and the second one, and how high they are
FLOW_RESOLUTION = 32  # of the motion in a flame; even
RISE = 4.0  # that this motion rises in a series, radians of a box 2 pi wide
WIDTH, TOP = 0.45, 0.8  # of a flame at its widest, half sides of the cube; and its height, sides
SWAY, FLICKER = 0.16, 0.2  # of a flame, sideways and up, at its top, for motion of mean speed 1


def sphere(size: int) -> Grid:
    """Make a ball that fades outwards: 1 at the centre, falling smoothly (cosine) to 0 at the faces.

    With a transfer function that is opaque at high values and faint at low ones it is the paper's synthetic
    sphere: an opaque centre in a low-opacity shell.
    """
    axis = torch.linspace(-1, 1, size)
    distance = (axis[:, None, None] ** 2 + axis[:, None] ** 2 + axis**2).sqrt()
    return _grid(0.5 + 0.5 * torch.cos(pi * distance.clamp_max(1)))


def orbital(size: int) -> Grid:
    """Sample the wave function of the electron of a hydrogen atom: 0.5 where it is 0.

    Along +y are a lobe and a ring, both above it, and their mirror image, below it.
    """
    return _grid(torch.from_numpy(0.5 + 0.5 * orbital_cube(size, *ORBITAL)))


def turbulence(size: int, seed: int = 0) -> Grid:
    """Sample the vorticity magnitude of decaying turbulence in a periodic box: thin, bright vortex tubes.

    A direct numerical simulation from random solenoidal motion; see `navier_stokes.evolve`. Divided by the
    largest magnitude.
    """
    (velocity,) = evolve(random_flow(TURBULENCE_RESOLUTION, 1.5, 2.5, seed), VISCOSITY, [DURATION])
    vorticity = curl(velocity)
    place = _places(size)
    squared = torch.zeros(size, size, size)
    for component in vorticity:
        squared += sample(component, place, place, place).square()
    largest = torch.linalg.vector_norm(to_field(vorticity), dim=0).max()
    return _grid(squared.sqrt() / largest)


def jets(size: int, seed: int = 0) -> Grid:
    """Sample the upward velocity of five jets that enter through the floor, roll up and break into puffs.

    A stand-in for the five jets data set, not the data. The jets are simulated as they develop in time,
    moving along with their shear layers; height stands for time (Taylor's hypothesis).
    """
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


def rings(size: int, time: float) -> Grid:
    """Make the vorticity magnitude of two rings on one axis that climb and pass through each other.

    The hind one narrows and slips through the other one, which widens, and they change places. Their
    cores have Gaussian profiles, thinner where the ring is wider: fluid keeps its volume, and its vorticity
    grows as it is stretched (Helmholtz).
    """
    axis = torch.linspace(-1, 1, size)
    z, y, x = torch.meshgrid(axis, axis, axis, indexing="ij")
    distance, azimuth = torch.hypot(x, z), torch.atan2(z, x)
    total = torch.zeros_like(x)
    for start, waves in zip((0, pi), WAVES, strict=True):
        turn = pi * time + start
        wave = CREST * torch.cos(waves * azimuth + turn)
        radius = RADIUS + TURN[0] * cos(turn)
        height = CLIMB * (time - 0.5) + TURN[1] * sin(turn) + wave
        stretch = radius / RADIUS
        square = (distance - radius - wave).square() + (y - height).square()
        total += stretch * torch.exp(-square * stretch / CORE**2)
    return Grid((total / (1 + TURN[0] / RADIUS)).clamp(0, 1).numpy())


def flame(size: int, time: float, seed: int = 0) -> Grid:
    """Make the temperature of a flame that flickers: tongues part from it and burn out.

    Random motion without divergence rises through it as it is (Taylor's hypothesis), and moves it the more
    the higher.
    """
    flow = random_flow(FLOW_RESOLUTION, 0.5, 5.0, seed)
    place = pi * torch.linspace(0, 1, size)  # half of the box in which the motion repeats itself
    height = torch.linspace(0, 1, size)[:, None]
    z, x = torch.linspace(-1, 1, size)[:, None, None], torch.linspace(-1, 1, size)
    along_x, along_y, along_z = sample(flow, place, place - RISE * time, place)
    above = (height + FLICKER * height * along_y) / TOP
    distance = torch.hypot(x - SWAY * height * along_x, z - SWAY * height * along_z)
    width = WIDTH * (above.clamp(0, 1) + 0.12).sqrt() * (1.2 - above).clamp_min(0.02)
    return Grid((torch.exp(-((distance / width) ** 2)) * (1 - above**3).clamp(0, 1)).numpy())


def random_flow(size: int, mean_energy: float, peak: float, seed: int) -> Tensor:
    """Return a spectrum [3, size, size, size // 2 + 1], complex64, of random motion without divergence.

    Energy per wavenumber follows k^4 exp(-2 (k / peak)^2), with nothing at k >= 8, so the motion does not
    depend on `size`, which is even. The mean of |v|^2 / 2 is `mean_energy`.
    """
    noise = np.random.default_rng(seed).standard_normal((3, *[NOISE_RESOLUTION] * 3))
    flow = to_spectrum(torch.from_numpy(noise))
    k = torch.linalg.vector_norm(wavevectors(flow), dim=0)
    flow = project(flow) * k * torch.exp(-((k / peak) ** 2)) * (k < NOISE_RESOLUTION / 2)
    flow *= (mean_energy / energy(flow)) ** 0.5
    place = _places(size).double()
    return to_spectrum(sample(flow, place, place, place).float())


def _five_jets(n: int) -> Tensor:
    """Return the spectrum of round jets of speed 1 along +y, one in the middle, seen at half their speed."""
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
    """Return the coordinates [size] of samples of a periodic box along one axis."""
    return 2 * pi / size * torch.arange(size)


def _grid(values: Tensor) -> Grid:
    """Return values as a volume."""
    return Grid(values.float().clamp(0, 1).numpy())


def orbital_cube(size: int, n: int, degree: int, order: int) -> Array:
    """Sample a wave function in a cube [size, size, size] (z, y, x) around the nucleus, its axis along +y.

    It is divided by the largest amplitude anywhere: between -1 and 1. The quantum numbers n, l and m are
    called `n`, `degree` and `order`.
    """
    r = np.linspace(0, 4 * n * (n + 2), STEPS)
    along_radius = np.abs(radial(n, degree, r))
    reach = r[np.flatnonzero(along_radius > AMPLITUDE_CUTOFF * along_radius.max())[-1] + 1]
    around = np.abs(angular(degree, abs(order), np.linspace(-1, 1, STEPS), np.zeros(1)))
    axis = np.linspace(-reach, reach, size)
    values = wave_function(n, degree, order, axis[:, None, None], axis, axis[:, None])
    return values / (along_radius.max() * around.max())


def wave_function(n: int, degree: int, order: int, x: Array, y: Array, z: Array) -> Array:
    """Return the amplitude of a real orbital whose axis is z, at places in Bohr radii.

    Its square is a density, and sums to 1 over space.
    """
    r = np.sqrt(x * x + y * y + z * z)
    cosine = np.divide(z, r, out=np.ones_like(r), where=r > 0)
    return radial(n, degree, r) * angular(degree, order, cosine, np.arctan2(y, x))


def radial(n: int, degree: int, r: Array) -> Array:
    """Return N rho^l exp(-rho / 2) L(rho) with rho = 2 r / n and an associated Laguerre polynomial L."""
    rho = 2 * r / n
    scale = sqrt((2 / n) ** 3 * factorial(n - degree - 1) / (2 * n * factorial(n + degree)))
    return scale * rho**degree * np.exp(-rho / 2) * eval_genlaguerre(n - degree - 1, 2 * degree + 1, rho)


def angular(degree: int, order: int, cosine: Array, azimuth: Array) -> Array:
    """Return a real spherical harmonic: it turns as cos(m azimuth), as sin(-m azimuth) where m is below 0."""
    m = abs(order)
    scale = sqrt((2 - (m == 0)) * (2 * degree + 1) / (4 * pi) * factorial(degree - m) / factorial(degree + m))
    turn = np.cos(m * azimuth) if order >= 0 else np.sin(m * azimuth)
    return (-1) ** m * scale * lpmv(m, degree, cosine) * turn  # scipy's functions hold a sign (-1)^m


GENERATORS: dict[str, Callable[..., Grid]] = {
    "sphere": sphere,
    "orbital": orbital,
    "turbulence": turbulence,
    "jets": jets,
}
SERIES: dict[str, Callable[..., Grid]] = {"rings": rings, "flame": flame}
RANDOM_GENERATORS = ("turbulence", "jets", "flame")  # generators, also of series, that depend on a seed


def series(name: str, size: int, steps: int) -> list[Grid]:
    """Make all steps of a series, from its beginning to its end."""
    return [SERIES[name](size, time) for time in torch.linspace(0, 1, steps).tolist()]
