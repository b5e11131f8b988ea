"""Stage `mesh`: the surface of a fit beside that of its volume, as the paper compares 3DGS and 2DGS."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.config.dataset import MeshKeys
from texgs.core.errors import ArgumentError
from texgs.fields.kinds import kinds
from texgs.report.results import MeshResult
from texgs.volume.basic_tfs import BasicTF, basic_tfs_of
from texgs.workflow.inputs import has_volume, last_phase, model_of, prepared_volume, without
from texgs.workflow.locate import basic_tf
from texgs.workflow.stage import Config, Outcome, Rule, Stage, read
from texgs.workflow.stages.settings import OfTF, Recipe

if TYPE_CHECKING:
    from texgs.core.camera import Camera
    from texgs.fields.field import Field
    from texgs.raster import Render
    from texgs.volume.isosurface import Mesh

ERRORS = ("chamfer", "accuracy", "completeness", "f_score", "normal_angle")
MEASURED = 200_000  # points on each surface
VISIBLE = 200  # pixels of the views that decide what can be seen


@dataclass(kw_only=True)
class Settings(OfTF):
    """What the stage reads of the configuration."""

    fit: Recipe
    tf_values: str = read("dataset.tf_values")
    points: BasicTF = read(basic_tf)
    mesh: MeshKeys = read(lambda config: without(config.mesh, "tfs"))
    fov_y: float = read("views.fov_y")  # degrees


def work(settings: Settings, inputs: dict[str, Path], output: Path) -> Outcome:
    """Write mesh.ply, reference.ply and mesh.png.

    It reads `model`, of the last phase of a fit; `views`, the transforms_train.json; `volume`.
    """
    from texgs.core.check import torch_device
    from texgs.fields.files import open_field
    from texgs.metrics.surface import are_visible, compare, sample
    from texgs.report.mesh_figure import write_mesh_figure
    from texgs.scene.mesh import depth_views, fuse, write_mesh
    from texgs.volume.framing import smallest_ball
    from texgs.volume.images import smaller
    from texgs.volume.view_set import read_views

    keys, views = settings.mesh, read_views(inputs["views"].parent)
    cameras = [smaller(view.camera, settings.fit.reduce) for view in views.train]
    reference = reference_of(settings, inputs["volume"])
    field = open_field(inputs["model"]).to(torch_device(settings.fit.device))
    start = time.perf_counter()
    seen = depth_views(shown_by(field), [camera.to(field.device) for camera in cameras])
    mesh = fuse(seen, keys.voxel)
    seconds = time.perf_counter() - start
    write_mesh(output / "mesh.ply", mesh)
    write_mesh(output / "reference.ply", reference)
    points, whole = sample(mesh, MEASURED), sample(reference, MEASURED)
    small = [smaller(camera, max(1, camera.width // VISIBLE)) for camera in cameras]
    visible = are_visible(whole, small, 2 * keys.voxel)
    errors = compare(points, whole[visible], keys.tolerance)
    title = f"{settings.dataset}/{settings.tf}, recipe {settings.fit.name}: {len(mesh.triangles):,} triangles"
    lens = smallest_ball(reference.vertices).lens(settings.fov_y)
    write_mesh_figure(output / "mesh.png", mesh, reference, whole[visible], lens, title)
    result = MeshResult(
        **{name: getattr(errors, name) for name in ERRORS},
        vertices=len(mesh.vertices),
        triangles=len(mesh.triangles),
        mesh_seconds=seconds,
        tolerance=keys.tolerance,
        visible=float(visible.double().mean()),
    )
    return Outcome(result)


def reference_of(settings: Settings, volume: Path) -> Mesh:
    """Return the surface that the basic TF makes of the volume."""
    from texgs.volume.isosurface import surface_of
    from texgs.volume.nrrd_file import open_grid

    (tf,) = basic_tfs_of(volume, {settings.tf: settings.points}, settings.tf_values).values()
    return surface_of(open_grid(volume), tf, settings.mesh.opacity)


def shown_by(field: Field) -> Callable[[Camera], Render]:
    """Return what renders a field with the depth that its meshes are made of."""
    import torch

    output = kinds()[field.kind].depth
    if not output:
        able = " or ".join(name for name, kind in kinds().items() if kind.depth)
        raise ArgumentError(f"mesh: expected a fit of {able}, got one of {field.kind}, which has no depth")
    black = torch.zeros(3, device=field.device)
    return lambda camera: field.render(camera, background=black, outputs=(output,))


def applies(config: Config) -> bool:
    """Return whether a mesh is made of the fit of a basic TF."""
    return has_volume(config) and config.tf in config.mesh.tfs and bool(kinds()[config.fit.field].depth)


STAGE = Stage(
    "mesh",
    order=110,
    help="make a mesh of a fit, and compare it with the isosurface of its volume",
    rule=Rule(
        "mesh",
        "{dataset}/{tf}/{fit}/mesh",
        ("mesh.ply", "reference.ply", "mesh.png"),
        target="meshes",
        gpu=("fit",),
        shown={"mesh.png": "The isosurface of the volume, the mesh of the fit, and its distance from it."},
    ),
    inputs=lambda config: {**prepared_volume(config), **model_of(last_phase(config))(config)},
    work=work,
    applies=applies,
)
