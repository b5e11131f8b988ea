"""Transfer functions whose ranges overlap, as one that shows all of them: for exploring, before a fit."""

from collections.abc import Callable, Mapping
from functools import lru_cache

import numpy as np

from texgs.volume.transfer import Array, TransferFunction, combine, just_above, left_limit, overlapping

PIECES = 8  # straight pieces between two points: products of transparencies are curves
MAX_OPACITY = 1 - 1e-9  # opacity whose extinction is still finite


def overlay(functions: Mapping[str, TransferFunction]) -> TransferFunction:
    """Combine several functions of a channel into one; ranges of values may overlap.

    Where they do, matter of all of them is at one place: extinctions add up, and colours are means that these
    weigh. Elsewhere, and without an overlap, it is what `combine` returns.
    """
    if overlapping(functions) is None:
        return combine(functions)
    each = list(functions.values())
    values = places(each)
    sides = mix(each, values, left_of), mix(each, values, TransferFunction.__call__)
    points = []
    for value, left, right in zip(values.tolist(), *sides, strict=True):
        points += [(value, *row) for row in ([left, right] if not np.allclose(left, right) else [right])]
    opacity = [(value, alpha) for value, *_, alpha in points]
    return each[0].with_points(opacity, [(value, *rgb) for value, *rgb, _ in points])


def overlays(functions: Mapping[str, TransferFunction]) -> list[TransferFunction]:
    """Combine the functions of each channel, and those of each within the same mask, into one."""
    sources = dict.fromkeys(tf.source for tf in functions.values())
    return [
        _overlay(tuple(each for each in functions.items() if each[1].source == source)) for source in sources
    ]


@lru_cache(maxsize=8)  # frames of a moving camera ask for the same
def _overlay(functions: tuple[tuple[str, TransferFunction], ...]) -> TransferFunction:
    return overlay(dict(functions))


def places(functions: list[TransferFunction]) -> Array:
    """Return ascending values [N] between which straight lines show all functions closely."""
    ends = [just_above(tf.opacity[-1][0]) for tf in functions if tf.opacity[-1][1] > 0]
    knots = np.unique([*(p[0] for tf in functions for p in (*tf.opacity, *tf.color)), *ends])
    shares = np.arange(PIECES) / PIECES
    between = knots[:-1, None] + np.diff(knots)[:, None] * shares
    return np.unique([*between.ravel(), knots[-1]])


def mix(
    functions: list[TransferFunction], values: Array, limit: Callable[[TransferFunction, Array], Array]
) -> Array:
    """Return r, g, b and opacity [N, 4] of all functions together, as limits from one side of values [N]."""
    limits = np.stack([limit(tf, values) for tf in functions])  # [F, N, 4]
    extinction = -np.log1p(-np.minimum(limits[..., 3], MAX_OPACITY))
    near = [(tf.support[0] <= values) & (values <= tf.support[1]) for tf in functions]
    weights = extinction + 1e-12 * (np.stack(near) + 1e-12)  # colours continue through invisible values
    color = (weights[..., None] * limits[..., :3]).sum(axis=0) / weights.sum(axis=0)[:, None]
    return np.column_stack([color, -np.expm1(-extinction.sum(axis=0))]).clip(0, 1)


def left_of(tf: TransferFunction, values: Array) -> Array:
    """Return r, g, b and opacity [N, 4] right below values."""
    opacity = left_limit(tf.opacity, values)
    opacity[(values <= tf.opacity[0][0]) | (values > tf.opacity[-1][0])] = 0
    return np.concatenate([left_limit(tf.color, values), opacity], axis=-1)
