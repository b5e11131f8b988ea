"""Check how far a scene is from its volume, over seeded views, lights and edits, and draw the worst."""

import argparse
import sys
from pathlib import Path

from texgs.cli.options import add_device, add_keys, keys_of, option, require_own_place
from texgs.core.lens import LensKeys


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the scene, what is looked at, and where to."""
    parser.add_argument("scene", type=Path, help="scene.yaml, which names its volume")
    words = ".json, and the worst views in a .png beside; default SCENE-check.json here"
    parser.add_argument("--output", type=Path, help=words)
    option(parser, "--views", 64, "number of views, each with a light and edits of its own; 19 or more")
    option(parser, "--seed", 0, "of what they show")
    add_keys(parser, LensKeys)
    parser.set_defaults(width=400)
    add_device(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the numbers and the picture."""
    from texgs.core.check import torch_device
    from texgs.core.errors import ArgumentError, errors_at
    from texgs.core.io import require_place
    from texgs.report.check import check
    from texgs.scene.scene_file import read_scene, scene_path
    from texgs.scene.twin import Twin

    arguments.scene = scene_path(arguments.scene)
    output = arguments.output or Path(f"{arguments.scene.stem}-check.json")
    if output.suffix != ".json":
        raise ArgumentError(f"--output: expected a file that ends in .json, got {output}")
    require_own_place(output)
    require_place(output)
    scene, device = read_scene(arguments.scene), torch_device(arguments.device)
    if scene.cuts:
        print(f"{arguments.scene}: its cuts are left out, as their faces show the volume", file=sys.stderr)
    with errors_at(arguments.scene):
        composition, twin = scene.open(device), Twin(scene, device)
    seen = (
        keys_of(arguments, LensKeys).lens(scene.framed(composition)),
        arguments.views,
        arguments.seed,
        output,
    )
    print(check(scene, composition, twin, *seen).sentence, output, sep="\n")
    return 0
