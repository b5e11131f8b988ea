"""The definition in float64 of light through cells of matter."""

from collections.abc import Sequence

import numpy as np
from scipy.ndimage import map_coordinates


def shares_of(
    extinction: np.ndarray,
    half: Sequence[float],
    to_light: Sequence[float],
    reach: float = np.inf,
) -> np.ndarray:
    """Share [z, y, x] of a distant light, from extinctions of the shortest edge of a cell.

    Columns lie in the light's direction and meet slice after slice of cells. Extinctions are linear between
    centres, and so is what columns let through between them. Only matter within `reach` world units hides a
    place, in whole slices.
    """
    edges = 2 * np.array(half) / extinction.shape[::-1]
    along = -np.array(to_light, float) / edges
    w = int(np.argmax(np.abs(along)))
    matter = np.moveaxis(extinction.T, w, 0)  # by slices
    ordered = matter[::-1] if along[w] < 0 else matter
    slope = np.delete(along, w) / abs(along[w])
    length = np.linalg.norm(to_light) / abs(along[w])
    slices, window = len(matter), int(np.clip(np.floor(min(reach, 9) / length + 0.5), 1, len(matter)))
    columns, centres = (
        np.stack(np.meshgrid(*(np.arange(-more, n + more) for n in ordered.shape[1:]), indexing="ij"))
        for more in (slices, 0)
    )
    met, shares = [], np.empty_like(ordered)
    for i, plane in enumerate(ordered):
        shift = slope[:, None, None] * i
        met.append(length / edges.min() * linear(plane, columns + shift))
        last = met[i - window] if i >= window else 0 * met[i]
        depth = sum(met[max(0, i - window + 1) : i]) + 0.5 * (met[i] + last)
        shares[i] = linear(2**-depth, centres - shift + slices)
    return np.moveaxis(shares[::-1] if along[w] < 0 else shares, 0, w).T


def linear(plane: np.ndarray, at: np.ndarray) -> np.ndarray:
    """A plane at places [2, ...], 0 beyond it."""
    return map_coordinates(plane, at, order=1, mode="grid-constant")
