"""Files of a scene or a model for other programs: splats, points or a mesh; or a compact model file."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import cast

import numpy as np
import torch

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.lens import Frame
from texgs.core.names import check_count, require_numbers
from texgs.fields import files
from texgs.fields.field import Field, Look
from texgs.fields.gaussians import Gaussians, JoinedGaussians
from texgs.fields.gaussians import write_ply as write_gaussians
from texgs.fields.kinds import Kind, kinds
from texgs.fields.part_edit import PartEdit
from texgs.fields.ply_columns import Told, colored, write_columns
from texgs.fields.splats import geometry
from texgs.fields.surfels.compact import seen_surfels, write_compact
from texgs.fields.surfels.composition import Composition, Part
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.ply import write_ply as write_surfels
from texgs.raster import Render
from texgs.raster.shading import Y00
from texgs.scene.bounds import bounds_of
from texgs.scene.clouds import clouds_of
from texgs.scene.clouds import placed as placed_cloud
from texgs.scene.gltf import write_gltf
from texgs.scene.joined import joined, write_vtp
from texgs.scene.mesh import fuse, placed, write_mesh
from texgs.scene.scene import Scene
from texgs.scene.spz import write_spz
from texgs.scene.usd import write_usd
from texgs.volume.cameras import icosphere_of
from texgs.volume.space import Space

OF_MODELS = ("release", "compact")  # need what surfels of different models do not share
OF_CLOUDS = ("usd", "gltf", "spz")  # of scenes, with their light
IN_FILE = ("points", "mesh", "vtp", "gltf")  # that are in the space of the volume's file by default
TAKES = {  # by kind: options of Export that count for it, besides the device
    "points": ("opacity", "space"),
    "mesh": ("voxel", "views", "size", "space"),
    "compact": ("views", "size", "drop_unseen"),
    **dict.fromkeys(("vtp", *OF_CLOUDS), ("space",)),
}


@dataclass(frozen=True)
class Export:
    """What to write."""

    kind: str  # 3dgs, 2dgs, release, points, mesh, compact, usd, gltf or spz
    opacity: float = 0.5  # least of points
    voxel: float = 1 / 256  # of a mesh, world units
    views: int = 92  # that a mesh is made from, and that unseen surfels are looked for in
    size: int = 512  # of these views, pixels
    drop_unseen: bool = False  # compact: no texture for surfels that no view sees
    device: torch.device | str = "cpu"
    space: str | None = None  # file, that of the scene's volume, or world; default: see `IN_FILE`
    known: Space | None = None  # that of the scene's volume

    def __post_init__(self) -> None:
        if self.space not in (None, "file", "world"):
            raise ArgumentError(f"space: expected file or world, got {self.space!r}")
        require_numbers(opacity=self.opacity, voxel=self.voxel)
        check_count("views", self.views)
        check_count("size", self.size)

    def cameras(self, frame: Frame) -> list[Camera]:
        """Return views of all that is framed."""
        placed = icosphere_of(self.views, frame.lens().square(self.size), "--views")
        return [camera.to(self.device) for camera in placed]

    @property
    def target(self) -> Space | None:
        """The space that places are moved to; None for the world."""
        if self.space == "file" and self.known is None:
            raise ArgumentError(
                "space: expected a scene that knows the space of its volume's file, got none; export it to "
                "the world, or make it again by texgs compose"
            )
        is_moved = self.kind in IN_FILE if self.space is None else self.space == "file"
        return self.known if is_moved else None

    @property
    def told(self) -> Told:
        """What the file says of the space that the scene knows."""
        if self.known is None:
            return None
        matrix = np.array(self.known.matrix, float).ravel().tolist()
        places = "space" if self.target else "world"
        return {"space": self.known.name, "unit": self.known.unit, "world_to_space": matrix, "places": places}


def require_export(field: Kind, kind: str) -> None:
    """Require of a kind of field that it can be exported as something."""
    if kind not in field.exports:
        able = " or ".join(name for name, other in kinds().items() if kind in other.exports)
        raise ArgumentError(
            f"--kind {kind}: expected {able}, got {field.name}, which can be exported as "
            f"{' or '.join(field.exports) or 'nothing'}"
        )


def taken(kind: str) -> list[str]:
    """Return the options of `Export` that count for a kind."""
    return [*TAKES.get(kind, ()), "device"]


def require_other(path: Path, scene: Scene) -> None:
    """Require a path that is none of the files which a scene reads."""
    files = [file for model in scene.models.values() for file in model.files if file]
    if path.resolve() in [file.resolve() for file in files]:
        raise ArgumentError(f"{path}: expected a new file, got one that the scene reads; choose another")


def remarks(scene: Scene, export: Export) -> list[str]:
    """Return what is to be told of a file of a scene: no kind holds cuts."""
    is_lost = export.kind in IN_FILE and export.space is None and scene.space is None
    lost = "in world units: the scene knows no space of a file; texgs compose writes it where there is one"
    return ["its cuts are left out"] * bool(scene.cuts) + [lost] * is_lost


def export_scene(path: Path, scene: Scene, export: Export) -> Path:
    """Export the visible models of a scene as one.

    Raises:
        ArgumentError, ShapeError: if its models cannot be exported so, nothing is visible, or the file cannot
            be written.
    """
    require_other(path, scene)
    for entry in scene.models.values():
        field = files.kind_of(entry.file)
        require_export(field, export.kind)
    export = replace(export, known=scene.space)
    space, told = export.target, export.told
    if export.kind in OF_CLOUDS:
        clouds = [cloud if space is None else placed_cloud(cloud, space) for cloud in clouds_of(scene)]
        if export.kind == "spz":
            return write_spz(path, clouds)
        return (write_usd if export.kind == "usd" else write_gltf)(path, clouds, told)
    composed, edits = scene.open(export.device), scene.edits
    if export.kind == "mesh":
        look: Look = "unshaded" if "unlit" in field.can else "shaded"
        render = partial(composed.render, edits=edits, look=look)
        return _write_fused(path, export, export.cameras(scene.framed(composed)), render, field.depth)
    if isinstance(composed, JoinedGaussians):
        return write_gaussians(path, composed.with_edits(edits), told)
    return _write(path, export, joined(cast(Composition, composed).parts, edits))


def export_model(path: Path, model: Field, export: Export) -> Path:
    """Export one model with all that the file can hold of it; raises as `export_scene`."""
    field = kinds()[model.kind]
    require_export(field, export.kind)
    model = model.to(export.device)
    if export.kind == "mesh":
        cameras, render = export.cameras(bounds_of([model])), model.render
        if isinstance(model, Surfels) and model.stage != "surfels":
            render = partial(Composition([model]).render, look="unshaded")
        return _write_fused(path, export, cameras, render, field.depth)
    if isinstance(model, Gaussians):
        return write_gaussians(path, model, export.told)
    return _write(path, export, cast(Surfels, model))


def _write(path: Path, export: Export, model: Surfels) -> Path:
    """Write surfels as they are, without rendering them."""
    if export.kind == "compact":
        cameras = export.cameras(bounds_of([model])) if export.drop_unseen else []
        return write_compact(path, model, seen_surfels(model, cameras) if cameras else None)
    if export.kind not in ("vtp", "points"):
        return write_surfels(path, model, export.kind, export.told)
    plain = joined([Part(model)], [PartEdit()]) if model.stage != "surfels" else model
    if export.kind == "vtp":
        return write_vtp(path, plain, export.target, export.told)
    return _write_points(path, plain, export)


def _write_fused(
    path: Path, export: Export, cameras: Sequence[Camera], render: Callable[..., Render], depth: str
) -> Path:
    """Write the mesh of what `render` shows, with the depth of that name."""
    shown = partial(render, background=torch.zeros(3, device=export.device), outputs=(depth,))
    mesh, space = fuse(shown, cameras, export.voxel), export.target
    return write_mesh(path, mesh if space is None else placed(mesh, space), export.told)


def _write_points(path: Path, model: Surfels, export: Export) -> Path:
    """Write a PLY point cloud: means of opaque surfels, and the colours of their constant harmonic, uint8."""
    means, _, _, opacities = geometry(model.parameters)
    opaque = opacities >= export.opacity
    if not bool(opaque.any()):
        most = float(opacities.max()) if len(opacities) else 0.0
        raise ArgumentError(
            f"{path}: expected surfels with an opacity of {export.opacity:g} at least, got {most:.3g} "
            "at most; lower the limit"
        )
    color = (0.5 + Y00 * model.parameters["sh"][:, 0])[opaque]
    places, space = means[opaque], export.target
    if space is not None:
        places = torch.from_numpy(space.points(places.cpu().numpy()))
    return write_columns(path, colored(places, color.clamp(0, 1).mul(255).round()), told=export.told)
