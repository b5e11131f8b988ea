"""Options that verbs share: those with a default, and the cameras of pictures."""

import argparse
from typing import Any

from texgs.core.lens import Lens

LENS = Lens()


def option(parser: argparse.ArgumentParser, name: str, default: Any, words: str, **more: Any) -> None:
    """Add an option with a default, whose type it has; the default stands behind its help."""
    shown = f"{words} (%(default)s)".lstrip()
    parser.add_argument(name, **{"type": type(default), "default": default, "help": shown, **more})


def add_device(parser: argparse.ArgumentParser) -> None:
    """Add where to compute."""
    option(parser, "--device", "cpu", "", choices=("cpu", "cuda"))


def add_lens(parser: argparse.ArgumentParser, width: str, height: str) -> None:
    """Add the size of pictures, in these words, and the distance and field of view of the camera."""
    option(parser, "--width", LENS.width, width)
    parser.add_argument("--height", type=int, help=height)
    option(parser, "--radius", LENS.radius, "distance, world units")
    option(parser, "--fov", LENS.fov_y, "vertical field of view, degrees")


def lens_of(arguments: argparse.Namespace) -> Lens:
    """Return what `add_lens` has added; pictures are square by default."""
    height = arguments.width if arguments.height is None else arguments.height
    return Lens(arguments.radius, arguments.fov, arguments.width, height)
