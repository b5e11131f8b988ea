"""Figure of a mesh: the true surface, the mesh, and its distance from the surface."""

from pathlib import Path

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.figures import Cell, Row, Scale
from texgs.core.geometry import facing
from texgs.core.lens import Lens
from texgs.metrics.surface import Points, distances, sample
from texgs.raster import Render, rasterize
from texgs.report.fit_figure import VISIBLE_ALPHA, draw_visible
from texgs.volume.cameras import orbit_path
from texgs.volume.isosurface import Mesh

DISCS = 300_000  # discs to draw a surface with
VIEW_SIZE = 640  # pixels
POLAR = 20.0  # polar angle of the cameras, degrees
MAX_ERROR = 0.02  # world units, the brightest colour of an error
CLAY, AMBIENT = 0.8, 0.2  # colour of a surface, and its ambient share


def write_mesh_figure(
    path: str | Path, mesh: Mesh, reference: Mesh, surface: Points, lens: Lens, title: str
) -> Path:
    """Draw a mesh beside the true surface from two sides, as PNG, in one step.

    Errors are distances from `surface`, points on what counts of the reference.
    """
    truth, ours = sample(reference, DISCS), sample(mesh, DISCS)
    error = Scale(0, MAX_ERROR, "inferno")
    errors, rows, visible = error(distances(ours, surface)[0]), [], []
    for index, camera in enumerate(orbit_path(2, POLAR, lens.square(VIEW_SIZE)), start=1):
        views = [
            render_points(truth, reference, shade(truth, camera), camera),
            render_points(ours, mesh, shade(ours, camera), camera),
            render_points(ours, mesh, errors, camera),
        ]
        names = {"isosurface of the volume": None, "mesh of the fit": None, "error, world units": error}
        cells = [
            Cell(name, view.color.clamp(0, 1), scale=scale)
            for (name, scale), view in zip(names.items(), views, strict=True)
        ]
        rows.append(Row(f"view {index}", cells))
        visible += [view.alpha > VISIBLE_ALPHA for view in views]
    return draw_visible(path, rows, torch.stack(visible).any(dim=0), title)


def shade(points: Points, camera: Camera) -> Tensor:
    """Return the grey [N, 3] of points under a light at the camera."""
    to_camera = camera.position.to(points.places) - points.places
    cosine = (points.normals * to_camera).sum(1) / to_camera.norm(dim=1)
    return (CLAY * (AMBIENT + (1 - AMBIENT) * cosine.clamp_min(0)))[:, None].expand(-1, 3)


def render_points(points: Points, mesh: Mesh, colors: Tensor, camera: Camera) -> Render:
    """Return the points of a mesh over white, each as an opaque disc that reaches to its neighbours."""
    a, b, c = torch.from_numpy(mesh.corners).unbind(1)
    area = torch.linalg.cross(b - a, c - a).norm(dim=1).sum() / 2
    spacing = float((area / len(points.places)).sqrt())
    return rasterize(
        points.places.float(),
        facing(points.normals).float(),
        torch.full((len(points.places), 2), spacing),
        torch.ones(len(points.places)),
        *(camera.viewmat, camera.K, camera.width, camera.height),
        features=colors.float().contiguous(),
        background=torch.ones(3),
    )
