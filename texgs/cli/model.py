"""Fit a model of a function that a scene tries, into the scene; or keep the function in a data set."""

from __future__ import annotations

import argparse
from functools import partial
from pathlib import Path

from texgs.cli.edit import require_scene
from texgs.cli.options import add_device, option, require_only_files
from texgs.core.errors import ArgumentError, errors_at
from texgs.core.names import new_part_file, require_name

LEAST_SIZE = 16  # pixels


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the scene, the function, and the new file."""
    parser.add_argument("scene", type=Path, help="scene.yaml, whose key functions has functions to try")
    parser.add_argument("name", help="of the function, which becomes that of the model")
    option(parser, "--size", 400, "of the views, pixels")
    goal = parser.add_mutually_exclusive_group(required=True)
    goal.add_argument("--output", type=Path, help="the new scene.yaml; models are put beside it")
    goal.add_argument("--keep", action="store_true", help="put the function into the file of its data set")
    add_device(parser)


def run(arguments: argparse.Namespace) -> int:
    """Write the scene with the model and its file, or the data set."""
    from texgs.config.kept_function import keep
    from texgs.core.check import torch_device
    from texgs.edit.function_model import fit_function, overlap_of
    from texgs.scene.session import Session

    session, name, output = Session.open(arguments.scene), arguments.name, arguments.output
    if arguments.keep:
        print(keep(session.scene, name))
        return 0
    require_scene(output)
    require_name(name, "NAME")
    if arguments.size < LEAST_SIZE:
        raise ArgumentError(f"--size: expected at least {LEAST_SIZE}, got {arguments.size}")
    file = partial(new_part_file, "model", output.parent, output.stem, name)
    with errors_at(arguments.scene):
        list(fit_function(session, name, file, torch_device(arguments.device), arguments.size, soon=False))
    print(f"{session.save(output)}{overlap_of(session.scene, name)}")
    return 0


def add_series_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the scene of one step, the files of all, and the folder of the series."""
    parser.add_argument("scene", type=Path, help="scene.yaml, whose volume is that of one of the steps")
    keys = "how the scene's volume was read, as for texgs new, such as up=+z; of a data set that is known"
    parser.add_argument("overrides", nargs="*", metavar="KEY=VALUE", help=keys)
    words = "volume of each step, a pattern such as 'step_*.nrrd' or 'visit_*/', or a file or folder with all"
    parser.add_argument("--files", nargs="+", required=True, metavar="FILE", help=words)
    parser.add_argument(
        "--output", type=Path, required=True, help="folder; the same again goes on where it stopped"
    )
    add_device(parser)


def run_series(arguments: argparse.Namespace) -> int:
    """Follow the models of a scene through the volumes of a series in time, with the same surfels and texels.

    `texgs edit time=3` shows a step of the new scene, `texgs render --path time` all of them.
    """
    from texgs.config.compose import compose
    from texgs.core.check import torch_device
    from texgs.edit.series import make_series
    from texgs.scene.scene_file import read_scene
    from texgs.volume.moments import matching

    require_only_files(arguments.files)
    with errors_at("--files"):
        files = matching(arguments.files)
    words = [f"dataset.volume.{word.removeprefix('dataset.volume.')}" for word in arguments.overrides]
    settings = compose(("dataset.volume.generator=null", *words)).dataset.volume if words else None
    scene, device = read_scene(arguments.scene), torch_device(arguments.device)
    print(make_series(scene, files, arguments.output, device, settings))
    return 0
