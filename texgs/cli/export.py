"""Export a scene or a model for other programs: Gaussians, points or a mesh, or as a compact model file."""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from texgs.core.camera import Camera
    from texgs.fields.part_edit import PartEdit
    from texgs.fields.surfels.composition import Composition
    from texgs.fields.surfels.model import Surfels
    from texgs.raster import Render
    from texgs.scene.scene import Scene, SceneModel

KINDS = ("3dgs", "2dgs", "release", "points", "mesh", "compact")
DEFAULTS = {".ply": "3dgs", ".texgs": "compact"}
OF_MODELS = ("release", "compact")  # need what surfels of different models do not share


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to export, and where to."""
    parser.add_argument("source", type=Path, help="scene.yaml or a model file")
    parser.add_argument("--to", type=Path, required=True, metavar="FILE", help=".ply, or .texgs for compact")
    parser.add_argument(
        "--kind",
        choices=KINDS,
        help="3dgs or 2dgs for viewers of Gaussians, release as the paper's code has them, points with "
        "colours, mesh, or compact; default 3dgs for .ply, compact for .texgs",
    )
    parser.add_argument(
        "--model",
        metavar="NAME",
        help="one model of a scene, with the textures that it has there and no other edit of it",
    )
    parser.add_argument("--opacity", type=float, default=0.5, help="least of points (%(default)s)")
    parser.add_argument("--voxel", type=float, default=1 / 256, help="of a mesh, world units (%(default)s)")
    parser.add_argument("--views", type=int, default=92, help="that a mesh is made from (%(default)s)")
    parser.add_argument("--size", type=int, default=512, help="of these views, pixels (%(default)s)")
    parser.add_argument(
        "--drop-unseen", action="store_true", help="compact: no texture for surfels that none of --views sees"
    )
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="(%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Write the file."""
    from texgs.fields.surfels.compact import open_model
    from texgs.scene.scene_file import read_scene

    kind = kind_of(arguments)
    if arguments.source.suffix in (".yaml", ".yml"):
        scene = read_scene(arguments.source)
        if arguments.model is not None:
            entry = chosen(scene, arguments.model)
            print(of_model(arguments, entry.surfels()[0].to(arguments.device), kind))
            return 0
        print(of_scene(arguments, composition_of(scene, arguments.device), scene.edits, kind))
    else:
        print(of_model(arguments, open_model(arguments.source).to(arguments.device), kind))
    return 0


def composition_of(scene: "Scene", device: str) -> "Composition":
    """The surfels of a scene, joined.

    Raises:
        ArgumentError: if it has none, but fields of another kind.
    """
    from texgs.core.errors import ArgumentError
    from texgs.fields.surfels.composition import Composition

    composed = scene.open(device)
    if not isinstance(composed, Composition):
        raise ArgumentError("export: expected a scene of surfels, got fields of another kind")
    return composed


def chosen(scene: "Scene", name: str) -> "SceneModel":
    """The model of a scene that has a name.

    Raises:
        ArgumentError: if there is none.
    """
    from texgs.core.errors import ArgumentError

    if name not in scene.models:
        raise ArgumentError(f"--model: expected one of {', '.join(scene.models)}, got {name}")
    return scene.models[name]


def kind_of(arguments: argparse.Namespace) -> str:
    """What to export.

    Raises:
        ArgumentError: if the ending of the file is of another kind, or a scene has no such thing.
    """
    from texgs.core.errors import ArgumentError

    ending = arguments.to.suffix
    kind: str | None = arguments.kind or DEFAULTS.get(ending)
    expected = {None: ".ply or .texgs", "compact": ".texgs"}.get(kind, ".ply")
    if kind is None or ending != expected:
        raise ArgumentError(f"--to: expected a file that ends in {expected}, got {arguments.to}")
    is_scene = arguments.source.suffix in (".yaml", ".yml")
    if arguments.model is not None and not is_scene:
        raise ArgumentError(
            f"--model: expected a scene to choose it from, got {arguments.source}; leave it out"
        )
    if kind in OF_MODELS and is_scene and arguments.model is None:
        raise ArgumentError(
            f"--kind {kind}: expected a model file, got {arguments.source}; export its models one by one, "
            "by --model"
        )
    return kind


def of_scene(
    arguments: argparse.Namespace, scene: "Composition", edits: "Sequence[PartEdit]", kind: str
) -> Path:
    """Export the visible models of a scene as one."""
    from texgs.fields.surfels.ply import write_ply
    from texgs.scene.export import joined, write_points

    if kind == "mesh":
        black = scene.means.new_zeros(3)
        return write_fused(
            arguments,
            lambda camera: scene.render(
                camera, edits=edits, look="unshaded", background=black, outputs=("median",)
            ),
        )
    surfels = joined(scene.parts, edits)
    if kind == "points":
        return write_points(arguments.to, surfels, arguments.opacity)
    return write_ply(arguments.to, surfels, kind)


def of_model(arguments: argparse.Namespace, model: "Surfels", kind: str) -> Path:
    """Export one model; Gaussians with all that they can hold of it."""
    from texgs.fields.part_edit import PartEdit
    from texgs.fields.surfels.compact import seen_surfels, write_compact
    from texgs.fields.surfels.composition import Composition
    from texgs.fields.surfels.ply import write_ply
    from texgs.scene.export import write_points

    if kind == "compact":
        seen = seen_surfels(model, cameras(arguments)) if arguments.drop_unseen else None
        return write_compact(arguments.to, model, seen)
    if kind == "points":
        return write_points(arguments.to, model, arguments.opacity)
    if kind != "mesh":
        return write_ply(arguments.to, model, kind)
    if model.stage != "surfels":
        return of_scene(arguments, Composition([model]), [PartEdit()], kind)
    black = model.parameters["means"].new_zeros(3)
    return write_fused(arguments, lambda camera: model.render(camera, background=black, outputs=("median",)))


def write_fused(arguments: argparse.Namespace, show: "Callable[[Camera], Render]") -> Path:
    """Write the mesh of what `show` renders."""
    from texgs.scene.mesh import fuse, write_mesh

    placed = [camera.to(arguments.device) for camera in cameras(arguments)]
    return write_mesh(arguments.to, fuse(show, placed, arguments.voxel))


def cameras(arguments: argparse.Namespace) -> "list[Camera]":
    """As far from the scene as the paper's training views.

    Raises:
        ArgumentError: if no icosphere has so many views.
    """
    from texgs.core.lens import Lens
    from texgs.volume.cameras import icosphere_of

    return icosphere_of(arguments.views, Lens().square(arguments.size), "--views")
