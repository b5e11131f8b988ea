"""Render a scene to PNG, GIF or MP4: one view, the test path, an orbit, a light or a cut that moves."""

import argparse
from pathlib import Path

from texgs.cli.options import add_device, add_keys, keys_of, option, require_own_place
from texgs.core.errors import ArgumentError, errors_at
from texgs.scene.film import Film
from texgs.volume.slice_keys import SliceKeys


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to show, from where, and where to."""
    parser.add_argument("scene", type=Path, help="scene.yaml, a folder with one, or a model file")
    parser.add_argument(
        "--output",
        type=Path,
        help=".png, .gif, .mp4 or a folder; default SCENE.png here, or .mp4 for several frames",
    )
    add_keys(parser, Film)
    parser.add_argument("--slice", metavar="PLANE=NUMBER", help="show a slice, or all three, of the volume")
    add_keys(parser, SliceKeys, without=("plane", "number", "width"))
    compare = "show the scene, its volume or what it was as fitted, and their difference, with PSNR and SSIM"
    parser.add_argument("--compare", nargs="?", const="volume", choices=("volume", "fitted"), help=compare)
    option(parser, "--gain", 4.0, "factor on differences, 1 to 16")
    parser.add_argument("--caption", action="store_true", help="write below what texgs check has found")
    add_device(parser)


def run(arguments: argparse.Namespace) -> int:
    """Render and write."""
    film = keys_of(arguments, Film)
    require_compatible(arguments, film)
    from texgs.core.check import torch_device
    from texgs.core.image import with_caption
    from texgs.report.check import found_sentence
    from texgs.report.compared import SideBySide
    from texgs.scene.scene_file import read_scene, scene_path
    from texgs.scene.session import Session
    from texgs.scene.twin import needs_twin

    arguments.scene = scene_path(arguments.scene)
    scene = read_scene(arguments.scene)
    ending = ".png" if film.count == 1 else ".mp4"
    output = arguments.output or Path(f"{arguments.scene.stem}{ending}")
    require_own_place(output)
    session = Session(scene, torch_device(arguments.device))
    with errors_at(arguments.scene):
        composition = session.composition
    shots, beside = film.shots(scene, composition), None
    if arguments.slice:
        plane, _, number = arguments.slice.partition("=")
        frames = iter([session.slices(keys_of(arguments, SliceKeys, plane=plane, number=number or None))])
    elif arguments.compare:
        with errors_at(arguments.scene):
            beside = SideBySide(session, arguments.compare, arguments.gain)
        frames = beside.frames(shots)
    else:
        with errors_at(arguments.scene):
            if needs_twin(scene, film.mode):
                session.twin_of(scene)
        frames = (session.picture(camera, film, shown) for camera, shown in shots)
    words = found_sentence(arguments.scene, scene)
    if arguments.caption:
        require_checked(arguments.scene, words)
        frames = (with_caption(each, words) for each in frames)
    path = film.write(output, frames, words, title=str(output))
    print(*(beside.sentences if beside else ()), path, sep="\n")
    return 0


def require_compatible(arguments: argparse.Namespace, film: Film) -> None:
    """Refuse options that do not go together."""
    if film.keys and film.what != "view":
        raise ArgumentError(f"--film: expected no --path, got {film.what}; leave one of them out")
    if film.transparent and (arguments.compare or arguments.caption):
        raise ArgumentError("--transparent: expected neither --compare nor --caption; leave them out")
    if arguments.compare and film.mode != "shaded":
        raise ArgumentError(f"--compare: expected --mode shaded, got {film.mode}; leave one of them out")
    if film.legend and (arguments.compare or arguments.slice):
        raise ArgumentError("--legend: expected neither --compare nor --slice; leave one of them out")
    others = film.mode != "shaded" or film.count > 1 or film.transparent or arguments.compare
    if arguments.slice and others:
        raise ArgumentError("--slice: expected no --mode, --path, --transparent or --compare; leave them out")


def require_checked(scene: Path, words: str) -> None:
    """Require that `texgs check` has found something of a scene."""
    if not words:
        raise ArgumentError(
            f"--caption: expected {scene.stem}-check.json here or beside the scene, of its models and "
            f"shadows as they are; run texgs check {scene} first"
        )
