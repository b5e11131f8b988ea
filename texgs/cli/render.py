"""Render a scene to PNG, GIF or MP4: one view, the paper's test path, an orbit, or a light that moves."""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, get_args

from texgs.core.errors import ArgumentError
from texgs.core.lens import Lens

if TYPE_CHECKING:
    from texgs.core.camera import Camera
    from texgs.core.light import Light

LENS = Lens()
MOST_FRAMES = 100_000  # an hour of film
PATHS = {"view": 1, "test": 181, "orbit": 72, "light": 61}  # frames by default


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to show, from where, and where to."""
    parser.add_argument("scene", type=Path, help="scene.yaml")
    parser.add_argument(
        "--output",
        type=Path,
        help=".png, .gif, .mp4 or a folder; default SCENE.png here, or .mp4 for several frames",
    )
    parser.add_argument(
        "--mode",
        default="shaded",
        help="shaded, unshaded, normal, depth, alpha, texture, discs, or a factor of the material: ambient, "
        "diffuse, specular or shininess (%(default)s)",
    )
    parser.add_argument("--path", choices=PATHS, default="view", help="camera or light path (%(default)s)")
    parser.add_argument("--frames", type=int, help="default test 181, orbit 72, light 61")
    add_lens(parser, "pixels (%(default)s)", "pixels; default the width")
    parser.add_argument(
        "--azimuth",
        type=float,
        default=30.0,
        help="azimuth of the camera, on an orbit of the first frame, degrees (%(default)s); not for test",
    )
    parser.add_argument(
        "--polar",
        type=float,
        default=20.0,
        help="angle above the horizon, degrees (%(default)s); not for path test",
    )
    parser.add_argument("--fps", type=float, default=25.0, help="frames per second (%(default)s)")
    parser.add_argument("--device", choices=("cpu", "cuda"), default="cpu", help="(%(default)s)")


def add_lens(parser: argparse.ArgumentParser, width: str, height: str) -> None:
    """Add the size of pictures, whose help is given, and the distance and field of view of the camera."""
    parser.add_argument("--width", type=int, default=LENS.width, help=width)
    parser.add_argument("--height", type=int, help=height)
    distance, fov = "distance, world units (%(default)s)", "vertical field of view, degrees (%(default)s)"
    parser.add_argument("--radius", type=float, default=LENS.radius, help=distance)
    parser.add_argument("--fov", type=float, default=LENS.fov_y, help=fov)


def lens_of(arguments: argparse.Namespace) -> Lens:
    """Return what `add_lens` has added; pictures are square by default."""
    height = arguments.width if arguments.height is None else arguments.height
    return Lens(arguments.radius, arguments.fov, arguments.width, height)


def run(arguments: argparse.Namespace) -> int:
    """Render and write."""
    from texgs.core.check import torch_device
    from texgs.core.movie import write_frames
    from texgs.core.progress import progress
    from texgs.scene.frame import Mode, frame
    from texgs.scene.scene_file import read_scene

    if arguments.mode not in get_args(Mode):
        raise ArgumentError(f"--mode: expected one of {', '.join(get_args(Mode))}, got {arguments.mode}")
    scene = read_scene(arguments.scene)
    count = frames_of(arguments)
    shots = shots_of(arguments, scene.light, count)
    suffix = ".png" if count == 1 else ".mp4"
    output = arguments.output or Path(f"{arguments.scene.stem}{suffix}")
    composition = scene.open(torch_device(arguments.device))
    frames = (
        frame(composition, camera, light, scene.edits, arguments.mode, scene.background)
        for camera, light in progress(shots, count, title=str(output), unit="frame")
    )
    print(write_frames(output, frames, arguments.fps))
    return 0


def frames_of(arguments: argparse.Namespace) -> int:
    """Return how many frames to render."""
    count = PATHS[arguments.path] if arguments.frames is None else int(arguments.frames)
    if not 1 <= count <= MOST_FRAMES:
        bound = "at least 1" if count < 1 else f"at most {MOST_FRAMES}"
        raise ArgumentError(f"--frames: expected {bound}, got {count}")
    return count


def shots_of(arguments: argparse.Namespace, light: Light, count: int) -> Iterator[tuple[Camera, Light]]:
    """Return camera and light of each frame, of so many."""
    from texgs.core.camera import orbit
    from texgs.core.light import Light
    from texgs.volume.cameras import orbit_path, spiral

    lens = lens_of(arguments)
    if arguments.path == "test":
        return ((camera, light) for camera in spiral(count, *lens))
    if arguments.path == "orbit":
        turn = orbit_path(count, arguments.polar, *lens, start=arguments.azimuth)
        return ((camera, light) for camera in turn)
    camera = orbit(arguments.azimuth, arguments.polar, *lens)
    if arguments.path == "view":
        return ((camera, light) for _ in range(count))
    # as the paper shows relighting: from below the object to above it, on the camera's side
    angles = (-90 + 180 * i / max(count - 1, 1) for i in range(count))
    return ((camera, Light("directional", arguments.azimuth, polar)) for polar in angles)
