"""The visible part of a volume under a transfer function as a surface of triangles."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.core.memory import require_memory
from texgs.volume.grid import Grid, Triple
from texgs.volume.label_masks import HALF
from texgs.volume.transfer import TransferFunction

BYTES_PER_SAMPLE = 8  # of memory for a sample: what is opaque, in single precision, and the mesh
OUTSIDE_FACTOR = 1000.0  # times the largest value, around a volume: its surface ends at the outermost samples


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
    """Return the surface of a volume under a transfer function, where its opacity rises to a value.

    Where an opaque middle of its range has two sides, both are surfaces; and so are the faces of the volume's
    box, where what is opaque ends there.
    """
    mask = None if tf.within is None else grid.channel(tf.within).values
    grid = grid.channel(tf.channel)
    least, most = float(np.nanmin(grid.values)), float(np.nanmax(grid.values))  # missing samples: transparent
    span = max(most - least, 1e-30)
    require_memory(
        BYTES_PER_SAMPLE * grid.values.size, "the surface of the volume", "prepare it with reduce=2"
    )
    # In a shell of samples so low that the surface ends at the outermost of the volume.
    shelled = np.full([size + 2 for size in grid.values.shape], -OUTSIDE_FACTOR * span, np.float32)
    signed = shelled[1:-1, 1:-1, 1:-1]  # positive in opaque matter
    signed[:] = -span
    for low, high in opaque_ranges(tf, opacity):
        # A range that holds the largest values does not end there, nor does one with the smallest begin.
        for values, slab in zip(grid.values, signed, strict=True):
            above = values - np.float32(low) if low > least else span
            below = np.float32(high) - values if high < most else span
            np.fmax(slab, np.minimum(above, below), out=slab)
    for inside, slab in zip([] if mask is None else mask, signed, strict=False):
        np.minimum(slab, (inside - np.float32(HALF)) * np.float32(span / HALF), out=slab)
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
