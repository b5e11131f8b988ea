"""Volumes that change in time, made here for examples and tests: two vortex rings, and a flame.

Cubes as those of `texgs.volume.generate`, the same for the same arguments up to rounding. Both are made of
formulas: a moment costs no more than its samples. Time goes from 0 to 1.
"""

from collections.abc import Callable
from math import cos, pi, sin

import torch

from texgs.volume.generate import random_flow
from texgs.volume.grid import Grid
from texgs.volume.navier_stokes import sample

RADIUS, CORE = 0.42, 0.11  # of rings and of their cores, half sides of the cube
TURN = (0.14, 0.2)  # half axes of the ellipse on which the rings turn about each other: radius and height
CLIMB = 0.5  # of both, in a series
WAVES, CREST = (4, 7), 0.05  # around the first ring and the second one, and how high they are
FLOW_RESOLUTION = 32  # of the motion in a flame; even
RISE = 4.0  # that this motion rises in a series, radians of a box 2 pi wide
WIDTH, TOP = 0.45, 0.8  # of a flame at its widest, half sides of the cube; and its height, sides
SWAY, FLICKER = 0.16, 0.2  # of a flame, sideways and up, at its top, for motion of mean speed 1


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


SERIES: dict[str, Callable[..., Grid]] = {"rings": rings, "flame": flame}


def series(name: str, size: int, steps: int) -> list[Grid]:
    """Make all steps of a series, from its beginning to its end."""
    return [SERIES[name](size, time) for time in torch.linspace(0, 1, steps).tolist()]
