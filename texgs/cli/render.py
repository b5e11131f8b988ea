"""Render a scene to PNG, GIF or MP4: one view, the test path, an orbit, a light or a cut that moves."""

from __future__ import annotations

import argparse
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from texgs.cli.options import add_device, add_lens, lens_of, option, require_own_place
from texgs.core.errors import ArgumentError, located
from texgs.scene.paths import PATHS

if TYPE_CHECKING:
    import numpy as np

    from texgs.core.camera import Camera
    from texgs.raster import Render
    from texgs.scene.scene import Scene
    from texgs.scene.session import Session

MOST_FRAMES = 100_000  # an hour of film
MOST_GAIN = 16.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to show, from where, and where to."""
    parser.add_argument("scene", type=Path, help="scene.yaml, a folder with one, or a model file")
    parser.add_argument(
        "--output",
        type=Path,
        help=".png, .gif, .mp4 or a folder; default SCENE.png here, or .mp4 for several frames",
    )
    modes = (
        "shaded, volume, unshaded, normal, depth, alpha, texture, discs, or a factor of the material: "
        "ambient, diffuse, specular or shininess"
    )
    option(parser, "--mode", "shaded", modes)
    option(parser, "--path", "view", "of the camera, the light, the last plane, or time", choices=PATHS)
    length = parser.add_mutually_exclusive_group()
    length.add_argument("--frames", type=int, help="default test 181, orbit and orbit-time 72, else 61")
    length.add_argument("--seconds", type=float, help="length of a film, in place of a number of frames")
    add_lens(parser, "pixels", "pixels; default the width")
    azimuth = "azimuth of the camera, not for path test, on an orbit of the first frame, degrees"
    option(parser, "--azimuth", 30.0, azimuth)
    option(parser, "--polar", 20.0, "angle above the horizon, not for path test, degrees")
    option(parser, "--fps", 25.0, "frames per second")
    compare = "show the scene, its volume or what it was as fitted, and their difference, with PSNR and SSIM"
    parser.add_argument("--compare", nargs="?", const="volume", choices=("volume", "fitted"), help=compare)
    option(parser, "--gain", 4.0, f"factor on differences, 1 to {MOST_GAIN:g}")
    words = "PNG with alpha in place of the background"
    parser.add_argument("--transparent", action="store_true", help=words)
    parser.add_argument("--caption", action="store_true", help="write below what texgs check has found")
    add_device(parser)


def run(arguments: argparse.Namespace) -> int:
    """Render and write."""
    from texgs.core.check import torch_device
    from texgs.core.image import with_caption
    from texgs.core.movie import write_frames
    from texgs.core.progress import progress
    from texgs.report.check import checked
    from texgs.scene.frame import Mode
    from texgs.scene.paths import shots_of
    from texgs.scene.scene_file import read_scene, scene_path
    from texgs.scene.session import Session
    from texgs.scene.twin import needs_twin

    if arguments.mode not in get_args(Mode):
        raise ArgumentError(f"--mode: expected one of {', '.join(get_args(Mode))}, got {arguments.mode}")
    arguments.scene = scene_path(arguments.scene)
    scene = read_scene(arguments.scene)
    count = frames_of(arguments)
    output = output_of(arguments, count)
    session = Session(scene, torch_device(arguments.device))
    with located(arguments.scene):
        composition = session.composition
    lens = lens_of(arguments, scene.framed(composition))
    place = (arguments.azimuth, arguments.polar)
    shots = shots_of(scene, composition, arguments.path, count, lens, *place)
    shots = progress(shots, count, title=str(output), unit="frame")
    if arguments.compare:
        frames = compared(arguments, session, shots)
    else:
        with located(arguments.scene):
            if needs_twin(scene, arguments.mode):
                session.twin_of(scene)
        shows = partial(session.frame, mode=arguments.mode, transparent=arguments.transparent)
        frames = (shows(camera, scene=shown) for camera, shown in shots)
    words = checked(arguments.scene, scene)
    if arguments.caption:
        require_checked(arguments.scene, words)
        frames = (with_caption(each, words) for each in frames)
    print(write_frames(output, frames, arguments.fps, comment=words))
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


def output_of(arguments: argparse.Namespace, count: int) -> Path:
    """Return where to write so many frames."""
    output = arguments.output or Path(f"{arguments.scene.stem}{'.png' if count == 1 else '.mp4'}")
    require_own_place(output)
    if count > 1 and output.suffix == ".png":
        raise ArgumentError(f"{output}: expected one frame, got {count}; use .gif, .mp4 or a folder")
    is_alone = not arguments.compare and not arguments.caption
    if arguments.transparent and not (is_alone and output.suffix in ("", ".png")):
        raise ArgumentError(f"--transparent: expected PNG without --compare and --caption, got {output}")
    return output


def frames_of(arguments: argparse.Namespace) -> int:
    """Return how many frames to render."""
    count = PATHS[arguments.path] if arguments.frames is None else arguments.frames
    if arguments.seconds is not None:
        if not arguments.seconds > 0:
            raise ArgumentError(f"--seconds: expected more than 0, got {arguments.seconds:g}")
        if not arguments.fps > 0:
            raise ArgumentError(f"--fps: expected more than 0, got {arguments.fps:g}")
        count = arguments.seconds * arguments.fps
    if not 1 <= count <= MOST_FRAMES:
        bound = "at least 1" if count < 1 else f"at most {MOST_FRAMES}"
        raise ArgumentError(f"--frames: expected {bound}, got {count}")
    return round(count)
