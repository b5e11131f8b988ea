"""Export a scene or a model: splats, points or a mesh, a compact model file, or a page for a browser."""

import argparse
import sys
from dataclasses import replace
from pathlib import Path

from texgs.cli.options import add_keys, keys_of, require_own_place
from texgs.core.errors import ArgumentError
from texgs.core.names import SCENES
from texgs.scene.export_keys import ENDINGS, Export
from texgs.viewer import PAGE_VOLUME


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to export, and where to."""
    parser.add_argument("scene", type=Path, help="scene.yaml, a folder with one, or a model file")
    parser.add_argument("--to", "--output", type=Path, required=True, metavar="FILE", help=" ".join(ENDINGS))
    add_keys(parser, Export, without=("volume",))
    words = (
        f"html: with the volume of the scene in so many MB ({PAGE_VOLUME:g}), to show any transfer function"
    )
    words += ", the volume beside the scene, and faces of cuts"
    parser.add_argument("--volume", nargs="?", const=PAGE_VOLUME, metavar="MB", help=words)


def run(arguments: argparse.Namespace) -> int:
    """Write the file."""
    keys = keys_of(arguments, Export)
    require_own_place(arguments.to, "--to")
    from texgs.report.check import found_sentence
    from texgs.scene.scene_file import read_scene, scene_path, title_of
    from texgs.viewer.export import export

    source = scene_path(arguments.scene)
    scene = read_scene(source)
    if source.suffix not in SCENES:
        if keys.model is not None:
            raise ArgumentError(f"--model: expected a scene to choose it from, got {source}; leave it out")
        keys = replace(keys, model=next(iter(scene.models)))
    notes = export(arguments.to, scene, keys, found_sentence(source, scene), title_of(source))
    print(arguments.to)
    for note in notes:
        print(f"{arguments.to}: {note}", file=sys.stderr)
    return 0
