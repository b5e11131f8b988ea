"""The ball of a volume's visible part under transfer functions, the target of cameras."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from itertools import combinations, pairwise, product

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.lens import Frame
from texgs.volume.grid import Grid
from texgs.volume.label_masks import HALF, INSIDE
from texgs.volume.slabs import ArraySource, slab_bounds
from texgs.volume.transfer import TransferFunction

SQUARE_SLACK = 1 + 1e-7  # times a squared radius: rounding, of points that nearly lie in a plane too


def frame_of(grid: Grid, tfs: Iterable[TransferFunction]) -> Frame:
    """Return the smallest ball around all cells that are visible under a basic transfer function.

    A patient is seen first from the front.

    Raises:
        ArgumentError: if nothing is visible.
    """
    ball, front = smallest_ball(shown_corners(grid, tfs)), grid.world.front
    return ball if front is None else replace(ball, azimuth=front)


def out_of_frame(grid: Grid, tf: TransferFunction, frame: Frame) -> str:
    """Describe how far a function extends beyond a frame, in half a sentence, or ""."""
    reach = float(np.linalg.norm(shown_corners(grid, [tf]) - frame.target, axis=1).max())
    if reach <= frame.radius * SQUARE_SLACK:
        return ""
    return (
        f"reaches {reach - frame.radius:.2g} out of the frame of radius {frame.radius:.2g}: what views do "
        "not show is not fitted; to frame it and make all views and models anew, add it to dataset.framed_by"
    )


def shown_corners(grid: Grid, tfs: Iterable[TransferFunction]) -> np.ndarray:
    """Return the outermost corners [N, 3], world units, of rows of cells with values that functions show."""
    seen: dict[tuple[int, int | None], list[tuple[np.float64, np.float64]]] = {}
    for tf in tfs:
        seen.setdefault(tf.source, []).extend(shown_values(tf))
    corners = [np.empty((0, 3), int)]
    for (channel, mask), ranges in seen.items():
        for start, stop in slab_bounds(ArraySource(grid), 0, grid.dims[2] - 1):
            cells = shown_cells(grid.channel(channel).values[start : stop + 1], ranges)
            if mask is not None:
                cells &= shown_cells(grid.channel(mask).values[start : stop + 1], [(HALF, INSIDE)])
            corners.append(outermost(cells, start))
    indices = np.concatenate(corners)
    if not len(indices):
        raise ArgumentError("transfer functions: expected some of the volume to be visible, got nothing")
    middle = 0.5 * (np.array(grid.dims) - 1)
    return np.asarray((indices - middle) * grid.spacing * grid.scale)


def shown_values(tf: TransferFunction) -> list[tuple[np.float64, np.float64]]:
    """Return the closed ranges of values that are visible under a transfer function."""
    ranges: list[tuple[np.float64, np.float64]] = []
    for (low, before), (high, after) in pairwise(tf.opacity):
        if max(before, after) > 0:
            start = np.float64(low) if before > 0 else np.nextafter(low, np.inf)
            end = np.float64(high) if after > 0 else np.nextafter(high, -np.inf)
            if before > 0 and ranges and ranges[-1][1] == low:
                start = ranges.pop()[0]
            ranges.append((start, end))
    return ranges


def shown_cells(values: np.ndarray, seen: Sequence[tuple[float, float]]) -> np.ndarray:
    """Return of cells [Z - 1, Y - 1, X - 1] between samples [Z, Y, X] whether they show one of the ranges."""
    least = most = values
    for _ in range(3):  # axis by axis: the first one goes to the end
        least = np.moveaxis(np.minimum(least[1:], least[:-1]), 0, -1)
        most = np.moveaxis(np.maximum(most[1:], most[:-1]), 0, -1)
    shown = np.zeros(least.shape, dtype=bool)
    for low, high in seen:
        shown |= (least <= high) & (most >= low)
    return shown


def outermost(cells: np.ndarray, start: int) -> np.ndarray:
    """Return x, y, z [N, 3], z from start, of corners of the first and last true cell [Z, Y, X] of rows."""
    z, y = np.nonzero(cells.any(axis=2))
    rows = cells[z, y]
    ends = rows.argmax(axis=1), rows.shape[1] - rows[:, ::-1].argmax(axis=1)
    corners = product(ends, (y, y + 1), (z + start, z + start + 1))
    return np.concatenate([np.stack(corner, axis=1) for corner in corners])


def smallest_ball(points: np.ndarray) -> Frame:
    """Return the smallest ball around points [N, 3], N > 0, up to rounding.

    At most four points on its rim decide. As long as one is outside, the farthest comes in, and the ball is
    that of these few points: it grows with each (Welzl 1991 and Gaertner 1999 choose them one by one).
    """
    points = points.astype(np.float64)
    rim = points[:1]
    center, square = rim[0], 0.0
    while True:
        distances = np.square(points - center).sum(axis=1)
        farthest = int(distances.argmax())
        if distances[farthest] <= square * SQUARE_SLACK:
            break
        grown = around_few(np.concatenate([rim, points[farthest : farthest + 1]]))
        if grown[1] <= square:
            break
        center, square, rim = grown
    return Frame(center.tolist(), float(np.sqrt(square)))


def around_few(points: np.ndarray) -> tuple[np.ndarray, float, np.ndarray]:
    """Return centre and squared radius of the smallest ball around up to five points, and its rim."""
    balls = []
    for count in range(1, min(len(points), 4) + 1):
        for rim in map(list, combinations(range(len(points)), count)):
            sides = points[rim[1:]] - points[rim[0]]
            step = np.linalg.lstsq(sides, 0.5 * np.square(sides).sum(axis=1))[0]
            center = points[rim[0]] + step
            square = float(np.square(step).sum())
            if np.square(points - center).sum(axis=1).max() <= square * SQUARE_SLACK:
                balls.append((square, center, points[rim]))
    square, center, rim_points = min(balls, key=lambda ball: ball[0])
    return center, square, rim_points
