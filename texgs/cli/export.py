"""Export a scene or a model: splats, points or a mesh, a compact model file, or a page for a browser."""

from __future__ import annotations

import argparse
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.cli.options import add_device, option, require_own_place
from texgs.core.errors import ArgumentError
from texgs.core.names import EXPORTS, SCENES
from texgs.viewer import PAGE_VOLUME

if TYPE_CHECKING:
    from texgs.scene.scene import Scene

ENDINGS = list(dict.fromkeys(ending for endings in EXPORTS.values() for ending in endings))
DEFAULTS = {ending: next(kind for kind in EXPORTS if ending in EXPORTS[kind]) for ending in ENDINGS}
BAKED = "Surfels have one colour each, the mean of their texture, with the light of the scene as harmonics"
OPTIONS = ("opacity", "voxel", "views", "size", "drop_unseen", "space", "device")  # that `Export` has, too


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to export, and where to."""
    parser.add_argument("source", type=Path, help="scene.yaml, a folder with one, or a model file")
    parser.add_argument("--to", "--output", type=Path, required=True, metavar="FILE", help=" ".join(ENDINGS))
    parser.add_argument(
        "--kind",
        choices=EXPORTS,
        help="3dgs or 2dgs for viewers of Gaussians, release as the paper's code has them, points with "
        "colours, mesh, vtp, polygons for ParaView, compact, html, a page that shows and edits the scene, or "
        "with light in the colours usd (OpenUSD), gltf (KHR_gaussian_splatting) or spz; default by the end",
    )
    parser.add_argument(
        "--model",
        metavar="NAME",
        help="one model of a scene, with the textures that it has there; other edits of it only in html, "
        "usd, gltf and spz",
    )
    parser.add_argument(
        "--volume",
        type=float,
        nargs="?",
        const=PAGE_VOLUME,
        metavar="MB",
        help=f"html: with the volume of the scene in so many MB ({PAGE_VOLUME:g}), to show any transfer "
        "function, the volume beside the scene, and faces of cuts",
    )
    words = "html: steps of a series that the page holds: all (default), one, the scene's, or each N-th"
    parser.add_argument("--steps", metavar="all|one|N", help=words)
    option(parser, "--opacity", 0.5, "points: leave out surfels with less opacity")
    option(parser, "--voxel", 1 / 256, "edge of a cell of a mesh, world units")
    option(parser, "--views", 92, "number of views that a mesh is made from")
    option(parser, "--size", 512, "of these views, pixels")
    parser.add_argument(
        "--drop-unseen", action="store_true", help="compact: no texture for surfels that none of --views sees"
    )
    words = "coordinates: those of the volume's file, such as a patient's mm (default of points, mesh, vtp "
    words += "and gltf), or of the world, in which the volume is centred and its longest side is 1"
    parser.add_argument("--space", choices=("file", "world"), help=words)
    add_device(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the file."""
    from texgs.scene.export import OF_CLOUDS, Export, export_model, export_scene, remarks, require_other
    from texgs.scene.scene_file import read_scene, scene_path

    arguments.source = scene_path(arguments.source)
    kind = kind_of(arguments)
    require_taken(arguments, kind)
    require_own_place(arguments.to, "--to")
    scene = read_scene(arguments.source)
    shown = chosen(arguments, scene)
    if kind == "html":
        print(of_page(arguments, shown))
        return 0
    options = {name: getattr(arguments, name) for name in OPTIONS}
    export = Export(kind, known=shown.space, **options)
    if kind in OF_CLOUDS or (arguments.source.suffix in SCENES and arguments.model is None):
        print(export_scene(arguments.to, shown, export))
        for note in [BAKED] * (kind in OF_CLOUDS) + remarks(shown, export):
            print(f"{arguments.to}: {note}", file=sys.stderr)
        return 0
    require_other(arguments.to, scene)
    (entry,) = shown.models.values()
    print(export_model(arguments.to, entry.open()[0], export))
    return 0


def kind_of(arguments: argparse.Namespace) -> str:
    """Return what to export."""
    from texgs.scene.export import OF_MODELS

    ending = arguments.to.suffix
    kind: str | None = arguments.kind or DEFAULTS.get(ending)
    expected = ENDINGS if kind is None else EXPORTS[kind]
    if kind is None or ending not in expected:
        raise ArgumentError(f"--to: expected a file that ends in {' or '.join(expected)}, got {arguments.to}")
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


def require_taken(arguments: argparse.Namespace, kind: str) -> None:
    """Require options that count for what is exported."""
    from texgs.scene.export import TAKES, Export, taken

    for name in ("volume", "steps"):
        if getattr(arguments, name) is not None and kind != "html":
            raise ArgumentError(f"--{name}: expected --to a page, .html, got {arguments.to}; leave it out")
    for name in OPTIONS:
        if name not in taken(kind) and getattr(arguments, name) != getattr(Export, name):
            able = " or ".join(each for each in TAKES if name in TAKES[each])
            raise ArgumentError(
                f"--{name.replace('_', '-')}: expected --kind {able}, got {kind}; leave it out"
            )


def chosen(arguments: argparse.Namespace, scene: Scene) -> Scene:
    """Return the scene, with the chosen model alone where there is one."""
    if arguments.model is None:
        return scene
    if arguments.model not in scene.models:
        raise ArgumentError(f"--model: expected one of {', '.join(scene.models)}, got {arguments.model}")
    return replace(scene, models={arguments.model: scene.models[arguments.model]})


def of_page(arguments: argparse.Namespace, scene: Scene) -> Path:
    """Export a scene, one model of it or a model file as a web page."""
    from texgs.fields import files
    from texgs.report.check import checked
    from texgs.scene.export import require_export
    from texgs.viewer.page_volume import page_volume
    from texgs.viewer.standalone import write_page

    for entry in scene.models.values():
        require_export(files.kind_of(entry.file), "html")
    volume = None
    if arguments.volume is not None:
        volume = page_volume(scene, arguments.volume)
        print(f"Volume in the page: {volume}", file=sys.stderr)
    found, steps = checked(arguments.source, scene), arguments.steps or "all"
    page = write_page(arguments.to, scene, arguments.to.stem, found, volume, steps)
    if page.steps is not None:
        print(f"Series in the page: {page.steps}", file=sys.stderr)
    return Path(arguments.to)
