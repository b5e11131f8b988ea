"""Picture of a mesh beside the isosurface that it should be, and its error."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.lens import Lens
from texgs.metrics.surface import Points, distances, nearest, sample
from texgs.report.strip import write_strip
from texgs.volume.cameras import orbit_path
from texgs.volume.isosurface import Mesh

SHOWN = 1_000_000  # points of the pictures
PICTURE = 300  # pixels
POLAR = 20.0  # of the two views, degrees
FAR = 0.02  # world units, the brightest colour of an error


def write_mesh_figure(
    path: Path, mesh: Mesh, reference: Mesh, surface: Points, lens: Lens, title: str
) -> Path:
    """Draw both surfaces under a light at the camera, and the distance of the mesh from the other, as PNG.

    Args:
        path: the file to write, in one step.
        mesh: of a fit.
        reference: the isosurface.
        surface: points of the reference that the mesh is compared with.
        lens: of the cameras, but for the size of images.
        title: beside each view.
    """
    from matplotlib import colormaps

    truth, ours = sample(reference, SHOWN), sample(mesh, SHOWN)
    error = (distances(ours, surface)[0] / FAR).clamp(0, 1).numpy()
    colored = torch.from_numpy(colormaps["inferno"](error)[:, :3])
    rows: dict[str, list[np.ndarray]] = {}
    for camera in orbit_path(2, POLAR, *lens.square(PICTURE)):
        name = f"{title}, view {len(rows) + 1}"
        rows[name] = [
            picture(truth.places, lit(truth, camera), camera),
            picture(ours.places, lit(ours, camera), camera),
            picture(ours.places, colored, camera),
        ]
    return write_strip(path, rows, ["isosurface of the volume", "mesh of the fit", f"error, 0 to {FAR:g}"])


def lit(points: Points, camera: Camera) -> Tensor:
    """Grey [N, 3] of points under a light at the camera."""
    to_camera = camera.position.to(points.places) - points.places
    cosine = (points.normals * to_camera).sum(1) / to_camera.norm(dim=1)
    return (0.15 + 0.85 * cosine.clamp_min(0))[:, None].expand(-1, 3)


def picture(places: Tensor, colors: Tensor, camera: Camera) -> np.ndarray:
    """An image [H, W, 3] of the nearest points of all pixels, over white."""
    first, _, _ = nearest(places, camera)
    image = torch.where((first >= 0)[:, None], colors[first.clamp_min(0)], 1.0)
    return image.reshape(camera.height, camera.width, 3).numpy()
