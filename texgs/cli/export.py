"""Export a scene or a model: Gaussians, points or a mesh, a compact model file, or a page for a browser."""

import argparse
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

if TYPE_CHECKING:
    from texgs.config.fields import Kind
    from texgs.core.camera import Camera
    from texgs.fields.field import Field, Look
    from texgs.fields.surfels.model import Surfels
    from texgs.raster import Render
    from texgs.scene.scene import Scene, SceneModel

KINDS = ("3dgs", "2dgs", "release", "points", "mesh", "compact", "html")
SCENES = (".yaml", ".yml")
ENDINGS = {"compact": ".texgs", "html": ".html"}  # of kinds that are not .ply
DEFAULTS = {".ply": "3dgs", **{ending: kind for kind, ending in ENDINGS.items()}}
OF_MODELS = ("release", "compact")  # need what surfels of different models do not share


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to export, and where to."""
    parser.add_argument("source", type=Path, help="scene.yaml or a model file")
    parser.add_argument("--to", type=Path, required=True, metavar="FILE", help=".ply, .texgs or .html")
    parser.add_argument(
        "--kind",
        choices=KINDS,
        help="3dgs or 2dgs for viewers of Gaussians, release as the paper's code has them, points with "
        "colours, mesh, compact, or html, a page that shows and edits the scene; default 3dgs for .ply, "
        "compact for .texgs, html for .html",
    )
    parser.add_argument(
        "--model",
        metavar="NAME",
        help="one model of a scene, with the textures that it has there; other edits of it only in html",
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
    from texgs.fields.files import open_field
    from texgs.scene.scene_file import read_scene

    kind = kind_of(arguments)
    scene = read_scene(arguments.source) if arguments.source.suffix in SCENES else None
    if kind == "html":
        print(of_page(arguments, scene))
        return 0
    if scene is not None and arguments.model is None:
        print(of_scene(arguments, scene, kind))
        return 0
    field = open_field(arguments.source) if scene is None else chosen(scene, arguments.model).open()[0]
    print(of_model(arguments, field.to(arguments.device), kind))
    return 0


def require_export(field: "Kind[Any]", kind: str) -> None:
    """Require of a kind of field that it can be exported as something.

    Raises:
        ArgumentError: naming what it can be exported as.
    """
    from texgs.config.fields import kinds
    from texgs.core.errors import ArgumentError

    if kind not in field.exports:
        able = " or ".join(name for name, other in kinds().items() if kind in other.exports)
        raise ArgumentError(
            f"--kind {kind}: expected {able}, got {field.name}, which can be exported as "
            f"{' or '.join(field.exports) or 'nothing'}"
        )


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
    expected = ".ply, .texgs or .html" if kind is None else ENDINGS.get(kind, ".ply")
    if kind is None or ending != expected:
        raise ArgumentError(f"--to: expected a file that ends in {expected}, got {arguments.to}")
    is_scene = arguments.source.suffix in SCENES
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


def of_page(arguments: argparse.Namespace, scene: "Scene | None") -> Path:
    """Export a scene, one model of it or a model file as a web page."""
    from texgs.fields import files
    from texgs.scene.scene import Scene, SceneModel
    from texgs.viewer.standalone import write_page

    source: Path = arguments.source
    if scene is None:
        scene = Scene({source.stem: SceneModel(source)})
    elif arguments.model is not None:
        scene = replace(scene, models={arguments.model: chosen(scene, arguments.model)})
    for entry in scene.models.values():
        require_export(files.kind_of(entry.file), "html")
    return write_page(arguments.to, scene, arguments.to.stem)


def of_scene(arguments: argparse.Namespace, scene: "Scene", kind: str) -> Path:
    """Export the visible models of a scene as one."""
    from texgs.fields import files
    from texgs.fields.gaussians.composition import JoinedGaussians
    from texgs.fields.gaussians.ply import write_ply
    from texgs.fields.surfels.composition import Composition
    from texgs.scene.export import joined

    composed, edits = scene.open(arguments.device), scene.edits
    field = files.kind_of(next(iter(scene.models.values())).file)
    require_export(field, kind)
    if kind == "mesh":
        look: Look = "unshaded" if "unlit" in field.can else "shaded"
        return write_fused(arguments, partial(composed.render, edits=edits, look=look), field.depth)
    if isinstance(composed, JoinedGaussians):
        return write_ply(arguments.to, composed.edited(edits))
    return of_surfels(arguments, joined(cast(Composition, composed).parts, edits), kind)


def of_model(arguments: argparse.Namespace, model: "Field", kind: str) -> Path:
    """Export one model with all that the file can hold of it."""
    from texgs.config.fields import kinds
    from texgs.fields.gaussians.model import Gaussians
    from texgs.fields.gaussians.ply import write_ply
    from texgs.fields.surfels.composition import Composition
    from texgs.fields.surfels.model import Surfels

    field = kinds()[model.kind]
    require_export(field, kind)
    if kind == "mesh":
        if isinstance(model, Surfels) and model.stage != "surfels":
            return write_fused(arguments, partial(Composition([model]).render, look="unshaded"), field.depth)
        return write_fused(arguments, model.render, field.depth)
    if isinstance(model, Gaussians):
        return write_ply(arguments.to, model)
    return of_surfels(arguments, cast(Surfels, model), kind)


def of_surfels(arguments: argparse.Namespace, model: "Surfels", kind: str) -> Path:
    """Export surfels as they are, without rendering them."""
    from texgs.fields.surfels.compact import seen_surfels, write_compact
    from texgs.fields.surfels.ply import write_ply
    from texgs.scene.export import write_points

    if kind == "compact":
        seen = seen_surfels(model, cameras(arguments)) if arguments.drop_unseen else None
        return write_compact(arguments.to, model, seen)
    if kind == "points":
        return write_points(arguments.to, model, arguments.opacity)
    return write_ply(arguments.to, model, kind)


def write_fused(arguments: argparse.Namespace, render: "Callable[..., Render]", depth: str) -> Path:
    """Write the mesh of what `render` shows, with the depth of that name."""
    import torch

    from texgs.scene.mesh import fuse, write_mesh

    black = torch.zeros(3, device=arguments.device)
    placed = [camera.to(arguments.device) for camera in cameras(arguments)]
    mesh = fuse(lambda camera: render(camera, background=black, outputs=(depth,)), placed, arguments.voxel)
    return write_mesh(arguments.to, mesh)


def cameras(arguments: argparse.Namespace) -> "list[Camera]":
    """As far from the scene as the paper's training views.

    Raises:
        ArgumentError: if no icosphere has so many views.
    """
    from texgs.core.lens import Lens
    from texgs.volume.cameras import icosphere_of

    return icosphere_of(arguments.views, Lens().square(arguments.size), "--views")
