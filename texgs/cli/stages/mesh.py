"""Stage `mesh`: the surface of a fit beside that of its volume, as the paper compares 3DGS and 2DGS."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from texgs.cli.stages.outcome import Outcome
from texgs.cli.stages.settings import OfTF, Recipe
from texgs.cli.stages.tf import in_data_values
from texgs.config.dataset import BasicTF
from texgs.config.fields import kinds
from texgs.config.mesh import MeshKeys
from texgs.core.camera import Camera
from texgs.core.device import torch_device
from texgs.core.errors import ArgumentError
from texgs.core.io import read_json
from texgs.fields.field import Field
from texgs.fields.files import open_field
from texgs.metrics.surface import Points, compare, distances, nearest, sample, seen
from texgs.raster import Render
from texgs.report.results import MeshResult
from texgs.report.strip import write_strip
from texgs.scene.mesh import fuse, write_mesh
from texgs.volume.cameras import orbit_path
from texgs.volume.isosurface import Mesh, surface_of
from texgs.volume.nrrd_file import open_grid
from texgs.volume.reduced import smaller
from texgs.volume.view_set import read_views

MEASURED = 200_000  # points on each surface
SHOWN = 1_000_000  # points of its pictures
VISIBLE = 200  # pixels of the views that decide what can be seen
PICTURE = 300  # pixels
FAR = 0.02  # world units, the brightest colour of an error


@dataclass
class Settings(OfTF):
    """What the stage reads of the configuration."""

    fit: Recipe
    tf_values: str
    points: BasicTF
    mesh: MeshKeys


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write mesh.ply, reference.ply and mesh.png.

    Args:
        settings: of the job.
        inputs: `model`, of the last phase of a fit; `views`, the transforms_train.json; `volume`.
        output: folder.
    """
    keys, views = settings.mesh, read_views(inputs["views"].parent)
    cameras = [smaller(view.camera, settings.fit.reduce) for view in views.train]
    reference = reference_of(settings, inputs["volume"])
    field = open_field(inputs["model"]).to(torch_device(settings.fit.device))
    start = time.perf_counter()
    mesh = fuse(shown_by(field), [camera.to(field.device) for camera in cameras], keys.voxel)
    seconds = time.perf_counter() - start
    write_mesh(output / "mesh.ply", mesh)
    write_mesh(output / "reference.ply", reference)
    points, whole = sample(mesh, MEASURED), sample(reference, MEASURED)
    small = [smaller(camera, max(1, camera.width // VISIBLE)) for camera in cameras]
    visible = seen(whole, small, 2 * keys.voxel)
    errors = compare(points, whole[visible], keys.tolerance)
    show(output / "mesh.png", mesh, reference, whole[visible], (settings.dataset, settings.tf))
    result = MeshResult(
        errors.chamfer,
        errors.accuracy,
        errors.completeness,
        errors.f_score,
        errors.normal_angle,
        len(mesh.vertices),
        len(mesh.triangles),
        seconds,
        keys.tolerance,
        float(visible.double().mean()),
    )
    return Outcome(
        result, {"mesh.png": "The isosurface of the volume, the mesh of the fit, and its distance from it."}
    )


def reference_of(settings: Settings, volume: Path) -> Mesh:
    """The surface that the basic TF makes of the volume."""
    grid, summary = open_grid(volume), read_json(volume.with_name("volume.json"))
    tf = in_data_values(
        settings.tf, settings.points, settings.tf_values, summary["minimum"], summary["maximum"]
    )
    return surface_of(grid, tf, settings.mesh.opacity)


def shown_by(field: Field) -> Callable[[Camera], Render]:
    """What renders a field with the depth that its meshes are made of.

    Raises:
        ArgumentError: for a field without depth.
    """
    output = kinds()[field.kind].depth
    if not output:
        able = " or ".join(name for name, kind in kinds().items() if kind.depth)
        raise ArgumentError(f"mesh: expected a fit of {able}, got one of {field.kind}, which has no depth")
    black = torch.zeros(3, device=field.device)
    return lambda camera: field.render(camera, background=black, outputs=(output,))


def show(path: Path, mesh: Mesh, reference: Mesh, surface: Points, title: Sequence[str]) -> None:
    """Write the picture: both surfaces under a light at the camera, and the error of the mesh."""
    from matplotlib import colormaps

    truth, ours = sample(reference, SHOWN), sample(mesh, SHOWN)
    error = (distances(ours, surface)[0] / FAR).clamp(0, 1).numpy()
    colored = torch.from_numpy(colormaps["inferno"](error)[:, :3])
    rows: dict[str, list[np.ndarray]] = {}
    for camera in orbit_path(2, 20.0, 4.0311, 22.0, PICTURE, PICTURE):
        name = f"{' '.join(title)}, view {len(rows) + 1}"
        rows[name] = [
            picture(truth.places, lit(truth, camera), camera),
            picture(ours.places, lit(ours, camera), camera),
            picture(ours.places, colored, camera),
        ]
    write_strip(path, rows, ["isosurface of the volume", "mesh of the fit", f"error, 0 to {FAR:g}"])


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
