"""Render a scene to PNG, GIF or MP4: one view, the test path, an orbit, a light or a cut that moves."""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.cli.options import add_device, add_keys, keys_of, option, require_own_place
from texgs.core.errors import ArgumentError, located
from texgs.scene.film import Film

if TYPE_CHECKING:
    import numpy as np

    from texgs.core.camera import Camera
    from texgs.raster import Render
    from texgs.scene.scene import Scene
    from texgs.scene.session import Session

MOST_GAIN = 16.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to show, from where, and where to."""
    parser.add_argument("scene", type=Path, help="scene.yaml, a folder with one, or a model file")
    parser.add_argument(
        "--output",
        type=Path,
        help=".png, .gif, .mp4 or a folder; default SCENE.png here, or .mp4 for several frames",
    )
    add_keys(parser, Film)
    compare = "show the scene, its volume or what it was as fitted, and their difference, with PSNR and SSIM"
    parser.add_argument("--compare", nargs="?", const="volume", choices=("volume", "fitted"), help=compare)
    option(parser, "--gain", 4.0, f"factor on differences, 1 to {MOST_GAIN:g}")
    parser.add_argument("--caption", action="store_true", help="write below what texgs check has found")
    add_device(parser)


def run(arguments: argparse.Namespace) -> int:
    """Render and write."""
    from texgs.core.check import torch_device
    from texgs.core.image import with_caption
    from texgs.report.check import checked
    from texgs.scene.scene_file import read_scene, scene_path
    from texgs.scene.session import Session
    from texgs.scene.twin import needs_twin

    film = keys_of(arguments, Film)
    arguments.scene = scene_path(arguments.scene)
    scene = read_scene(arguments.scene)
    if film.transparent and (arguments.compare or arguments.caption):
        raise ArgumentError("--transparent: expected neither --compare nor --caption; leave them out")
    ending = ".png" if film.count == 1 else ".mp4"
    output = arguments.output or Path(f"{arguments.scene.stem}{ending}")
    require_own_place(output)
    session = Session(scene, torch_device(arguments.device))
    with located(arguments.scene):
        composition = session.composition
    shots = film.shots(scene, composition)
    if arguments.compare:
        frames = compared(arguments, session, shots)
    else:
        with located(arguments.scene):
            if needs_twin(scene, film.mode):
                session.twin_of(scene)
        shows = partial(session.frame, mode=film.mode, transparent=film.transparent)
        frames = (shows(camera, scene=shown) for camera, shown in shots)
    words = checked(arguments.scene, scene)
    if arguments.caption:
        require_checked(arguments.scene, words)
        frames = (with_caption(each, words) for each in frames)
    print(film.write(output, frames, words, title=str(output)))
    return 0


def require_checked(scene: Path, words: str) -> None:
    """Require that `texgs check` has found something of a scene."""
    if not words:
        raise ArgumentError(
            f"--caption: expected {scene.stem}-check.json here or beside the scene, of its models as they "
            f"are; run texgs check {scene} first"
        )


def compared(
    arguments: argparse.Namespace, session: Session, shots: Iterable[tuple[Camera, Scene]]
) -> Iterator[np.ndarray]:
    """Yield frames of a scene beside its volume, or as fitted; what differs is printed at the end."""
    from texgs.metrics.quality import mean
    from texgs.report.beside_volume import changed, in_words, side_by_side, what_changed

    if arguments.mode != "shaded":
        raise ArgumentError(f"--compare: expected --mode shaded, got {arguments.mode}; leave one of them out")
    if not 1 <= arguments.gain <= MOST_GAIN:
        raise ArgumentError(f"--gain: expected 1 to {MOST_GAIN:g}, got {arguments.gain:g}")
    is_fitted = arguments.compare == "fitted"
    if session.scene.shows_volume and not is_fitted:
        raise ArgumentError(
            "--compare: expected a scene of models, got a cut one that shows its volume; take cuts back "
            "by texgs edit, or --compare fitted"
        )
    pair = pair_of(arguments, session, is_fitted)
    measured, edits = defaultdict[str, list[float]](list), []
    for camera, shown in shots:
        image, truth = pair(camera, shown)
        titles = ("scene", "as fitted" if is_fitted else "volume")
        picture, scores = side_by_side(image, truth, arguments.gain, titles)
        for name, value in scores.items():
            measured[name].append(value)
        edits.append(changed(image, truth))
        yield picture
    print(", ".join(in_words(mean(measured))))
    if is_fitted:
        print(what_changed(edits))


def pair_of(
    arguments: argparse.Namespace, session: Session, is_fitted: bool
) -> Callable[[Camera, Scene], tuple[Render, Render]]:
    """Return what renders a scene, and what it is compared with."""
    from texgs.fields.files import kind_of
    from texgs.scene.cut_view import beside_fitted

    if is_fitted:
        kind = kind_of(next(iter(session.scene.models.values())).file)
        outputs = ("depth", "normal") if "normals" in kind.can else ("depth",)
        open_one = session.composition_of
        return lambda camera, shown: beside_fitted(
            open_one(shown), open_one(shown.as_fitted), camera, shown, outputs
        )
    with located(arguments.scene):
        session.twin_of(session.scene)
    return session.beside
