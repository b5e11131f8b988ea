"""Render a small built-in scene from all sides: one PNG per view, a contact sheet and an animation."""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.errors import ArgumentError

if TYPE_CHECKING:
    from PIL.Image import Image

COLUMNS = 6  # of the contact sheet
THUMBNAIL = 240  # pixels
MILLISECONDS = 80  # per frame of the animation


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Where to write, how many views and how large."""
    parser.add_argument("--output", type=Path, default=Path("results/demo"), help="folder (%(default)s)")
    parser.add_argument("--frames", type=int, default=36, help="views around the scene (%(default)s)")
    parser.add_argument("--size", type=int, default=480, help="pixels along each side (%(default)s)")


def run(arguments: argparse.Namespace) -> int:
    """Render, write and tell where to look."""
    if arguments.frames < 1 or arguments.size < 1:
        raise ArgumentError(
            f"frames and size: expected at least 1, got {arguments.frames} and {arguments.size}"
        )
    from tqdm import tqdm

    from texgs.cli.demo_scene import knot_scene
    from texgs.cli.demo_view import view
    from texgs.core.image import to_pillow, write_png

    scene = knot_scene()
    pictures = []
    for index in tqdm(range(arguments.frames), desc="Rendering", unit="view"):
        color = view(scene, azimuth=-90 + 360 * index / arguments.frames, size=arguments.size)
        write_png(arguments.output / f"view_{index:03}.png", color)
        pictures.append(to_pillow(color))
    write_sheet(arguments.output / "sheet.png", pictures)
    write_animation(arguments.output / "turntable.png", pictures)
    print(f"{arguments.output}: {len(pictures)} views, sheet.png and turntable.png (an animation)")
    return 0


def write_sheet(path: Path, pictures: list[Image]) -> None:
    """Write up to 12 evenly spaced views side by side."""
    from PIL import Image

    from texgs.core.io import write_atomic

    n_shown = min(len(pictures), 2 * COLUMNS)
    shown = [pictures[index * len(pictures) // n_shown] for index in range(n_shown)]
    columns = min(COLUMNS, n_shown)
    rows = -(-n_shown // columns)
    sheet = Image.new("RGB", (columns * THUMBNAIL, rows * THUMBNAIL))
    for index, picture in enumerate(shown):
        thumbnail = picture.resize((THUMBNAIL, THUMBNAIL), Image.Resampling.LANCZOS)
        sheet.paste(thumbnail, (index % columns * THUMBNAIL, index // columns * THUMBNAIL))
    write_atomic(path, lambda file: sheet.save(file, format="PNG", optimize=True))


def write_animation(path: Path, pictures: list[Image]) -> None:
    """Write an endless animated PNG."""
    from texgs.core.io import write_atomic

    first, *rest = pictures
    options = {"save_all": True, "append_images": rest, "duration": MILLISECONDS, "loop": 0}
    write_atomic(path, lambda file: first.save(file, format="PNG", **options))
