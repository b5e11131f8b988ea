"""Many views in one file to look at: a contact sheet and an animation."""

from collections.abc import Sequence
from pathlib import Path

from PIL import Image

from texgs.core.io import write_atomic

COLUMNS = 6  # largest number of columns of a contact sheet
THUMBNAIL = 240  # pixels of a picture's longer side; larger ones are reduced
GUTTER = 6  # pixels between its pictures
MILLISECONDS = 80  # for each picture of an animation


def write_contact_sheet(path: str | Path, pictures: Sequence[Image.Image]) -> Path:
    """Write a PNG with rows of pictures of any mode and size, in reading order, over white."""
    shown = [_over_white(picture) for picture in pictures]
    for picture in shown:
        picture.thumbnail((THUMBNAIL, THUMBNAIL), Image.Resampling.LANCZOS, reducing_gap=None)
    width, height = max(picture.width for picture in shown), max(picture.height for picture in shown)
    columns = min(COLUMNS, len(shown))
    across, down = width + GUTTER, height + GUTTER  # from one picture to the next
    size = (columns * across - GUTTER, -(-len(shown) // columns) * down - GUTTER)
    sheet = Image.new("RGB", size, "white")
    for index, picture in enumerate(shown):
        left = index % columns * across + (width - picture.width) // 2
        top = index // columns * down + (height - picture.height) // 2
        sheet.paste(picture, (left, top))
    return write_atomic(path, lambda file: sheet.save(file, format="PNG", optimize=True))


def write_animation(path: str | Path, pictures: Sequence[Image.Image]) -> Path:
    """Write an animated PNG of pictures of one size over white that repeats without end."""
    first, *rest = [_over_white(picture) for picture in pictures]
    options = {"save_all": True, "append_images": rest, "duration": MILLISECONDS, "loop": 0}
    return write_atomic(path, lambda file: first.save(file, format="PNG", **options))


def _over_white(picture: Image.Image) -> Image.Image:
    """Return a picture over white."""
    layer = picture.convert("RGBA")
    return Image.alpha_composite(Image.new("RGBA", layer.size, "white"), layer).convert("RGB")
