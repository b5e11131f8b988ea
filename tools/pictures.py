"""Make the pictures of the README from the results of the demo.

`make demo && .venv/bin/python tools/pictures.py` writes hero.png, views.png, edits.png and looks.png in docs.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image, ImageDraw, ImageFont

from texgs.core.camera import Camera, orbit
from texgs.core.figures import content, write_grid
from texgs.core.lens import Lens
from texgs.core.progress import progress
from texgs.scene.frame import frame
from texgs.scene.scene_file import read_scene

RESULTS, DOCS = Path("results/orbital"), Path("docs")
SCENES = RESULTS / "scene" / "demo"
LOOKS = {  # title: scene file below SCENES
    "as fitted": "compose/scene.yaml",
    "recoloured": "pse/pse-2.yaml",
    "relit": "pse/pse-4.yaml",
    "stained glass": "edits/glass/scene.yaml",
    "gold": "edits/gold/scene.yaml",
    "painted": "edits/painted/scene.yaml",
    "one lobe in crimson": "edits/crimson/scene.yaml",
}
HERO = list(LOOKS)[:6]
COLUMNS, PANEL, LABEL = 3, 533, 34  # panels side by side, pixels of a panel and of its label


def shown(title: str, camera: Camera) -> np.ndarray:
    """A scene [H, W, 3], uint8, under its own light."""
    scene = read_scene(SCENES / LOOKS[title])
    return frame(scene.open(), camera, scene.light, scene.edits, background=scene.background)


def write_hero(path: Path) -> None:
    """Six looks of one scene, a label below each."""
    camera = orbit(30, 20, *Lens().square(2 * PANEL))
    pictures = [shown(title, camera) for title in progress(HERO, title=path.name, unit="look")]
    box = content(pictures)
    sheet = Image.new("RGB", (COLUMNS * PANEL, len(HERO) // COLUMNS * (PANEL + LABEL)), "white")
    draw, font = ImageDraw.Draw(sheet), ImageFont.load_default(24)
    for index, (title, picture) in enumerate(zip(HERO, pictures, strict=True)):
        left, top = index % COLUMNS * PANEL, index // COLUMNS * (PANEL + LABEL)
        panel = Image.fromarray(np.ascontiguousarray(picture[box]))
        sheet.paste(panel.resize((PANEL, PANEL), Image.Resampling.LANCZOS), (left, top))
        draw.text((left + PANEL // 2, top + PANEL + LABEL // 2), title, "black", font, anchor="mm")
    small(sheet, path)


def write_looks(path: Path) -> None:
    """Each edit from two sides."""
    titles = [title for title in LOOKS if title not in ("recoloured", "relit")]
    lens = Lens().square(512)
    sides = {"front": orbit(30, 20, *lens), "from above": orbit(150, 50, *lens)}
    rows = {side: [shown(title, camera) for title in titles] for side, camera in sides.items()}
    small(Image.open(write_grid(path, rows, titles)), path)


def write_views(path: Path) -> None:
    """The contact sheets of both basic transfer functions, one below the other."""
    sheets = [Image.open(RESULTS / tf / "sheet" / "sheet.png") for tf in ("TF01", "TF02")]
    size = max(sheet.width for sheet in sheets), sum(sheet.height for sheet in sheets)
    both = Image.new("RGB", size, "white")
    for index, sheet in enumerate(sheets):
        both.paste(sheet, ((size[0] - sheet.width) // 2, index * sheets[0].height))
    small(both, path)


def small(picture: Image.Image, path: Path) -> None:
    """Write a PNG with values rounded to multiples of 4, which halves the file."""
    pixels = np.asarray(picture.convert("RGB")).astype(int)
    rounded = ((pixels + 2) // 4 * 4).clip(0, 255).astype(np.uint8)
    Image.fromarray(rounded).save(path, optimize=True)
    print(f"{path}: {picture.width} x {picture.height}, {path.stat().st_size / 1024:.0f} KiB")


if __name__ == "__main__":
    write_hero(DOCS / "hero.png")
    write_views(DOCS / "views.png")
    small(Image.open(SCENES / "pse" / "pse.png"), DOCS / "edits.png")
    write_looks(DOCS / "looks.png")
