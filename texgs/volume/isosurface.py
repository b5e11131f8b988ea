"""What a transfer function shows of a volume as geometry: a surface of triangles, and points."""

from dataclasses import dataclass
from itertools import pairwise
from math import ceil

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.memory import require_memory
from texgs.volume.grid import Grid, Triple
from texgs.volume.transfer import TransferFunction

BYTES = 8  # of memory for a sample: what is opaque, in single precision, and the mesh
FAR_OUTSIDE = 1000.0  # times the largest value, around a volume: its surface ends at the outermost samples
MOST = 64_000_000  # samples to look at for points: a larger volume is looked at with a stride


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles."""

    vertices: np.ndarray  # [V, 3] float32, world units
    triangles: np.ndarray  # [F, 3] int32, counter-clockwise seen from outside
    colors: np.ndarray | None = None  # [V, 3] uint8

    @property
    def corners(self) -> np.ndarray:
        """Corners of the triangles [F, 3, 3]."""
        return self.vertices[self.triangles].astype(np.float64)


def isosurface(values: np.ndarray, level: float, spacing: Triple, origin: Triple) -> Mesh:
    """Find where values cross a level (flying edges, Schroeder et al. 2015); larger ones are inside.

    Values are [Z, Y, X]; spacing and origin x, y, z, in world units.
    """
    import pyvista  # slow to import

    image = pyvista.ImageData(dimensions=values.shape[::-1], spacing=spacing, origin=origin)
    image["values"] = np.ascontiguousarray(values).ravel()
    surface = image.contour([level], compute_normals=False, compute_scalars=False, method="flying_edges")
    if not surface.n_cells:
        return Mesh(np.empty((0, 3), np.float32), np.empty((0, 3), np.int32))
    return Mesh(np.asarray(surface.points, np.float32), surface.regular_faces.astype(np.int32))


def surface_of(grid: Grid, tf: TransferFunction, opacity: float) -> Mesh:
    """Return what a transfer function makes a surface of a volume: where its opacity rises to a value.

    Where an opaque middle of its range has two sides, both are surfaces; and so are the faces of the volume's
    box, where what is opaque ends there.
    """
    grid = grid.channel(tf.channel)
    least, most = float(np.nanmin(grid.values)), float(np.nanmax(grid.values))  # what is missing is clear
    span = max(most - least, 1e-30)
    require_memory(BYTES * grid.values.size, "the surface of the volume", "prepare it with reduce=2")
    # In a shell of samples so low that the surface ends at the outermost of the volume.
    shelled = np.full([size + 2 for size in grid.values.shape], -FAR_OUTSIDE * span, np.float32)
    signed = shelled[1:-1, 1:-1, 1:-1]  # above 0 in what is opaque
    signed[:] = -span
    for low, high in opaque_ranges(tf, opacity):
        # A range that holds the largest values does not end there, nor does one with the smallest begin.
        for values, slab in zip(grid.values, signed, strict=True):
            above = values - np.float32(low) if low > least else span
            below = np.float32(high) - values if high < most else span
            np.fmax(slab, np.minimum(above, below), out=slab)
    if not (signed > 0).any():
        raise ArgumentError(
            f"mesh.opacity: expected a transfer function that is as opaque as {opacity:g} somewhere in the "
            "volume, got one that lets more light through; choose another basic TF"
        )
    x, y, z = (grid.scale * step for step in grid.spacing)
    left, bottom, back = grid.aabb[0]
    return isosurface(shelled, 0.0, (x, y, z), (left - x, bottom - y, back - z))


def opaque_ranges(tf: TransferFunction, opacity: float) -> list[tuple[float, float]]:
    """Return ranges of values in which a transfer function is as opaque as that."""
    points = [(tf.opacity[0][0], 0.0), *tf.opacity, (tf.opacity[-1][0], 0.0)]
    crossed = [
        low + (high - low) * (opacity - before) / (after - before)
        for (low, before), (high, after) in pairwise(points)
        if (before < opacity) != (after < opacity)
    ]
    return list(zip(crossed[::2], crossed[1::2], strict=True))


def visible_voxels(grid: Grid, tf: TransferFunction, count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Draw `count` samples, the more likely the more opaque, each moved at random within its cell.

    Return points [N, 3] in world units, fewer if fewer samples are visible, and colours [N, 3]. One slice is
    in memory at a time (weighted reservoir sampling: Efraimidis and Spirakis 2006).
    """
    random, grid = np.random.default_rng(seed), grid.channel(tf.channel)
    stride = ceil((grid.values.size / MOST) ** (1 / 3)) if grid.values.size > MOST else 1
    keys, places, colors = np.empty(0), np.empty((0, 3)), np.empty((0, 3))
    for z in range(0, grid.values.shape[0], stride):
        rgba = tf(np.asarray(grid.values[z, ::stride, ::stride]))
        y, x = np.nonzero(rgba[..., 3] > 0)
        if not len(x):
            continue
        shown = rgba[y, x]
        own = np.log(random.random(len(x))) / shown[:, 3]  # the largest keys are the sample
        keys = np.concatenate([keys, own])
        places = np.concatenate([places, np.stack([x * stride, y * stride, np.full(len(x), z)], axis=1)])
        colors = np.concatenate([colors, shown[:, :3]])
        if len(keys) > count:
            best = np.argpartition(keys, -count)[-count:]
            keys, places, colors = keys[best], places[best], colors[best]
    if not len(keys):
        raise ArgumentError("volume: expected samples that the transfer function shows, found none")
    moved = places + stride * (random.random(places.shape) - 0.5)
    cell = grid.scale * np.array(grid.spacing)
    points = np.array(grid.aabb[0]) + cell * np.clip(moved, 0, np.array(grid.dims) - 1)
    return points.astype(np.float32), colors.astype(np.float32)
