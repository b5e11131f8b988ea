"""How far surfaces of labels, half of softened masks, are from those of their binary masks, in voxels.

`python -m benchmarks.label_surfaces OUTPUT.csv FILE...` has a row for each of the ten largest labels of each
file, and for those of nested balls: mean and 99th percentile of distances, from points spread over one of the
surfaces to the other, and back.
"""

import numpy as np
import pandas as pd

from benchmarks.command import call
from benchmarks.labels import Labelled, volumes
from texgs.core.progress import progress
from texgs.metrics.surface import sample
from texgs.volume.grid import ONES
from texgs.volume.isosurface import Mesh, isosurface
from texgs.volume.label_masks import HALF

POINTS = 20_000  # of a surface


def main(output: str, *files: str) -> None:
    """Measure, print and write a row for each label."""
    table = pd.DataFrame([row for volume in volumes(files) for row in measured(volume, POINTS)])
    print(table.round(3).to_string(index=False))
    table.round(4).to_csv(output, index=False, lineterminator="\n")


def measured(volume: Labelled, points: int) -> list[dict[str, object]]:
    """Return the row of each label of a volume."""
    rows = []
    for channel, number in enumerate(progress(volume.numbers, title=volume.name, unit="label")):
        mask, binary = (surface(grid.channel(channel).values) for grid in (volume.masks, volume.binary))
        row: dict[str, object] = {"volume": volume.name, "label": number}
        for way, pair in {"to the binary mask": (mask, binary), "and back": (binary, mask)}.items():
            found = distances(*pair, points)
            row |= {f"mean {way}": found.mean(), f"99 % {way}": np.percentile(found, 99)}
        rows.append(row)
    return rows


def surface(mask: np.ndarray) -> Mesh:
    """Return the surface of a mask [Z, Y, X] at one half, in voxels; closed where the mask ends."""
    ends = [np.flatnonzero(mask.any(axis=axes))[[0, -1]] for axes in ((1, 2), (0, 2), (0, 1))]
    kept = mask[tuple(slice(low, high + 1) for low, high in ends)]
    z, y, x = (float(low) - 1 for low, _ in ends)
    return isosurface(np.pad(kept, 1).astype(np.float32), HALF, ONES, (x, y, z))


def distances(start: Mesh, end: Mesh, points: int) -> np.ndarray:
    """Return how far points spread over one surface are from the triangles of another one [points]."""
    import pyvista

    places = pyvista.PolyData(sample(start, points).places.numpy())
    target = pyvista.PolyData.from_regular_faces(end.vertices, end.triangles)
    return np.abs(places.compute_implicit_distance(target)["implicit_distance"])


if __name__ == "__main__":
    call(main, "texgs.volume.label_masks")
