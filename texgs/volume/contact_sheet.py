"""Many views in one file to look at: a contact sheet and an animation."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from PIL import Image, ImageColor

from texgs.core.errors import ArgumentError
from texgs.core.io import write_atomic

ROWS = 2  # of a contact sheet, at most
GUTTER = 6  # pixels between its pictures


def write_contact_sheet(
    path: str | Path,
    pictures: Sequence[Image.Image],
    columns: int = 6,
    thumbnail: int = 240,
    background: str = "white",
) -> Path:
    """Write a PNG with up to two rows of evenly spaced pictures, in reading order.

    Args:
        path: target file.
        pictures: at least one, of any mode and size.
        columns: pictures per row.
        thumbnail: longer side of each, pixels; larger pictures are reduced to it, smaller ones stay.
        background: colour name or #rrggbb behind transparent pictures and around smaller ones.

    Returns:
        The path.

    Raises:
        ArgumentError: if there is no picture, or an argument is out of range.
    """
    if columns < 1 or thumbnail < 1:
        raise ArgumentError(
            f"sheet: expected columns and thumbnail of at least 1, got {columns} and {thumbnail}"
        )
    _check(path, pictures, background)
    n_shown = min(len(pictures), ROWS * columns)
    chosen = [pictures[index * len(pictures) // n_shown] for index in range(n_shown)]
    shown = [_thumbnail(_opaque(picture, background), thumbnail) for picture in chosen]
    width, height = max(picture.width for picture in shown), max(picture.height for picture in shown)
    columns = min(columns, n_shown)
    across, down = width + GUTTER, height + GUTTER  # from one picture to the next
    size = (columns * across - GUTTER, -(-n_shown // columns) * down - GUTTER)
    sheet = Image.new("RGB", size, background)
    for index, picture in enumerate(shown):
        left = index % columns * across + (width - picture.width) // 2
        top = index // columns * down + (height - picture.height) // 2
        sheet.paste(picture, (left, top))
    return write_atomic(path, lambda file: sheet.save(file, format="PNG", optimize=True))


def write_animation(
    path: str | Path, pictures: Sequence[Image.Image], milliseconds: int = 80, background: str = "white"
) -> Path:
    """Write an animated PNG that repeats without end.

    Args:
        path: target file.
        pictures: at least one; all of one size.
        milliseconds: per picture.
        background: colour name or #rrggbb behind transparent pictures.

    Returns:
        The path.

    Raises:
        ArgumentError: if there is no picture, their sizes differ, or an argument is out of range.
    """
    _check(path, pictures, background)
    if milliseconds < 1:
        raise ArgumentError(f"milliseconds: expected at least 1 per picture, got {milliseconds}")
    if other := next((picture.size for picture in pictures if picture.size != pictures[0].size), None):
        raise ArgumentError(
            f"{path}: expected pictures of one size, got {pictures[0].size} and {other} pixels"
        )
    first, *rest = [_opaque(picture, background) for picture in pictures]
    return write_atomic(
        path,
        lambda file: first.save(
            file, format="PNG", save_all=True, append_images=rest, duration=milliseconds, loop=0
        ),
    )


def _check(path: str | Path, pictures: Sequence[Image.Image], background: str) -> None:
    if not pictures:
        raise ArgumentError(f"{path}: expected at least one picture, got none")
    try:
        ImageColor.getrgb(background)
    except ValueError as error:
        raise ArgumentError(f"background: expected a colour name or #rrggbb, got {background!r}") from error


def _opaque(picture: Image.Image, background: str) -> Image.Image:
    """The picture over a background."""
    layer = picture.convert("RGBA")
    return Image.alpha_composite(Image.new("RGBA", layer.size, background), layer).convert("RGB")


def _thumbnail(picture: Image.Image, longest: int) -> Image.Image:
    """The picture with its longer side at `longest` pixels, or as it is where it is smaller."""
    if max(picture.size) <= longest:
        return picture
    scale = longest / max(picture.size)
    width, height = (max(1, round(scale * side)) for side in picture.size)
    return picture.resize((width, height), Image.Resampling.LANCZOS)
