"""Orbitals of the electron of a hydrogen atom, in closed form: smooth lobes and rings of either sign.

The quantum numbers n, l and m are called `n`, `degree` and `order`. Lengths are in Bohr radii.
"""

from __future__ import annotations

from math import factorial, pi, sqrt

import numpy as np
from scipy.special import eval_genlaguerre, lpmv

from texgs.core.errors import ArgumentError

Array = np.ndarray
FADED = 0.05  # of the largest amplitude along the radius: what is farther out than that is cut off
STEPS = 4096  # along the radius and the polar angle, where the largest amplitude is looked for


def orbital_cube(size: int, n: int, degree: int, order: int) -> Array:
    """Sample a wave function in a cube around the nucleus, its axis along +y.

    Args:
        size: samples along each side.
        n: principal quantum number, from 1 on.
        degree: of the angular momentum, 0 to n - 1.
        order: of its part along the axis, -degree to degree.

    Returns:
        [size, size, size] (z, y, x), divided by the largest amplitude anywhere: between -1 and 1.
    """
    if not 0 <= abs(order) <= degree < n:
        raise ArgumentError(
            f"orbital: expected 0 <= |order| <= degree < n, got n {n}, degree {degree}, order {order}"
        )
    r = np.linspace(0, 4 * n * (n + 2), STEPS)
    along_radius = np.abs(radial(n, degree, r))
    reach = r[np.flatnonzero(along_radius > FADED * along_radius.max())[-1] + 1]
    around = np.abs(angular(degree, abs(order), np.linspace(-1, 1, STEPS), np.zeros(1)))
    axis = np.linspace(-reach, reach, size)
    values = wave_function(n, degree, order, axis[:, None, None], axis, axis[:, None])
    return values / (along_radius.max() * around.max())


def wave_function(n: int, degree: int, order: int, x: Array, y: Array, z: Array) -> Array:
    """Amplitude of a real orbital whose axis is z; its square is a density, and sums to 1 over space."""
    r = np.sqrt(x * x + y * y + z * z)
    cosine = np.divide(z, r, out=np.ones_like(r), where=r > 0)
    return radial(n, degree, r) * angular(degree, order, cosine, np.arctan2(y, x))


def radial(n: int, degree: int, r: Array) -> Array:
    """N rho^l exp(-rho / 2) L(rho) with rho = 2 r / n and an associated Laguerre polynomial L."""
    rho = 2 * r / n
    scale = sqrt((2 / n) ** 3 * factorial(n - degree - 1) / (2 * n * factorial(n + degree)))
    return scale * rho**degree * np.exp(-rho / 2) * eval_genlaguerre(n - degree - 1, 2 * degree + 1, rho)


def angular(degree: int, order: int, cosine: Array, azimuth: Array) -> Array:
    """Real spherical harmonic; it turns as cos(m azimuth), or as sin(-m azimuth) where m is below 0."""
    m = abs(order)
    scale = sqrt((2 - (m == 0)) * (2 * degree + 1) / (4 * pi) * factorial(degree - m) / factorial(degree + m))
    turn = np.cos(m * azimuth) if order >= 0 else np.sin(m * azimuth)
    return (-1) ** m * scale * lpmv(m, degree, cosine) * turn  # scipy's functions hold a sign (-1)^m
