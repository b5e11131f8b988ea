"""A scene or a model as a file of other programs: Gaussians, points or a mesh; or as a compact model file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import cast

import torch

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.lens import Lens
from texgs.fields import files
from texgs.fields.field import Field, Look
from texgs.fields.gaussians.files import write_ply as write_gaussians
from texgs.fields.gaussians.model import Gaussians, JoinedGaussians
from texgs.fields.kinds import Kind, kinds
from texgs.fields.surfels.compact import seen_surfels, write_compact
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.ply import write_ply as write_surfels
from texgs.raster import Render
from texgs.scene.export import joined, write_points
from texgs.scene.mesh import fuse, write_mesh
from texgs.scene.scene import Scene
from texgs.volume.cameras import icosphere_of

OF_MODELS = ("release", "compact")  # need what surfels of different models do not share


@dataclass(frozen=True)
class Export:
    """What to write."""

    kind: str  # 3dgs, 2dgs, release, points, mesh or compact
    opacity: float = 0.5  # least of points
    voxel: float = 1 / 256  # of a mesh, world units
    views: int = 92  # that a mesh is made from, and that unseen surfels are looked for in
    size: int = 512  # of these views, pixels
    drop_unseen: bool = False  # compact: no texture for surfels that no view sees
    device: torch.device | str = "cpu"

    @property
    def cameras(self) -> list[Camera]:
        """As far from the scene as the paper's training views.

        Raises:
            ArgumentError: if no icosphere has so many views.
        """
        placed = icosphere_of(self.views, Lens().square(self.size), "--views")
        return [camera.to(self.device) for camera in placed]


def require_export(field: Kind, kind: str) -> None:
    """Require of a kind of field that it can be exported as something.

    Raises:
        ArgumentError: naming what it can be exported as.
    """
    if kind not in field.exports:
        able = " or ".join(name for name, other in kinds().items() if kind in other.exports)
        raise ArgumentError(
            f"--kind {kind}: expected {able}, got {field.name}, which can be exported as "
            f"{' or '.join(field.exports) or 'nothing'}"
        )


def export_scene(path: Path, scene: Scene, export: Export) -> Path:
    """Export the visible models of a scene as one.

    Raises:
        ArgumentError, ShapeError: if its models cannot be exported so, nothing is visible, or the file cannot
            be written.
    """
    field = files.kind_of(next(iter(scene.models.values())).file)
    require_export(field, export.kind)
    composed, edits = scene.open(export.device), scene.edits
    if export.kind == "mesh":
        look: Look = "unshaded" if "unlit" in field.can else "shaded"
        return _write_fused(path, export, partial(composed.render, edits=edits, look=look), field.depth)
    if isinstance(composed, JoinedGaussians):
        return write_gaussians(path, composed.edited(edits))
    return _write(path, export, joined(cast(Composition, composed).parts, edits))


def export_model(path: Path, model: Field, export: Export) -> Path:
    """Export one model with all that the file can hold of it.

    Raises:
        ArgumentError, ShapeError: as `export_scene`.
    """
    field = kinds()[model.kind]
    require_export(field, export.kind)
    model = model.to(export.device)
    if export.kind == "mesh":
        if isinstance(model, Surfels) and model.stage != "surfels":
            render = partial(Composition([model]).render, look="unshaded")
            return _write_fused(path, export, render, field.depth)
        return _write_fused(path, export, model.render, field.depth)
    if isinstance(model, Gaussians):
        return write_gaussians(path, model)
    return _write(path, export, cast(Surfels, model))


def _write(path: Path, export: Export, model: Surfels) -> Path:
    """Write surfels as they are, without rendering them."""
    if export.kind == "compact":
        seen = seen_surfels(model, export.cameras) if export.drop_unseen else None
        return write_compact(path, model, seen)
    if export.kind == "points":
        return write_points(path, model, export.opacity)
    return write_surfels(path, model, export.kind)


def _write_fused(path: Path, export: Export, render: Callable[..., Render], depth: str) -> Path:
    """Write the mesh of what `render` shows, with the depth of that name."""
    black = torch.zeros(3, device=export.device)

    def shown(camera: Camera) -> Render:
        return render(camera, background=black, outputs=(depth,))

    return write_mesh(path, fuse(shown, export.cameras, export.voxel))
