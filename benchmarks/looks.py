"""Looks of scenes: whether their picture can be named, and what they leave of the data.

`python -m benchmarks.looks FOLDER NAME=SCENE... --styles glass,...,FILE --set hue=0.3 --set pattern=0.7`
gives each scene each picture by each setting of `edit.image`, and writes FOLDER/looks.csv and a sheet a
setting. Looks stay in the folder, and a run goes on where it stopped. Pictures are those of texgs and files
that are named, among which the place of each is found. `told_of_all` counts all object pixels alike, also
those in which several functions show. It needs VGG-16.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from time import process_time
from typing import Any

import numpy as np
import pandas as pd
import torch
from PIL import Image

from texgs.core.camera import orbit
from texgs.core.figures import as_picture, grid_rows, lay_out
from texgs.edit.methods.style import picture_of
from texgs.edit.new_look import learn_look, look_task, readable_task, settings_of
from texgs.metrics.edits.readability import METRIC
from texgs.metrics.edits.retrieval import places_among
from texgs.metrics.metric import MeasuredScene, values_of
from texgs.metrics.readability import legend_colors, shares_of, told_by_hue
from texgs.metrics.retrieval import LAYERS, Likeness, scene_likeness, style_likeness
from texgs.models.pictures import PICTURES
from texgs.models.vgg import Vgg
from texgs.scene.film import COUNTS
from texgs.scene.frame import frame
from texgs.scene.parts import with_looks
from texgs.scene.scene import Scene
from texgs.scene.scene_file import read_scene, write_scene
from texgs.volume.cameras import spiral
from tools.style_likeness import picture_likeness

SHOWN = 200  # pixels of a picture in a sheet
MEASURED, SIZE = 4, 400  # views that are measured, and pixels of their sides


def look(scene: Scene, style: str, changes: str, folder: Path) -> tuple[Scene, float]:
    """Return a scene in a style, and the seconds of processor time that it took."""
    file, time = folder / "scene.yaml", folder / "seconds.txt"
    if time.exists():
        return read_scene(file), float(time.read_text())
    values: dict[str, Any] = dict(pair.split("=") for pair in changes.split(",") if pair)
    values = {key: float(x) if x.replace(".", "").isdigit() else x for key, x in values.items()}
    settings, start = settings_of("image", {**values, "style": style}), process_time()
    task = readable_task(look_task(scene, settings, [], folder / "files", torch.device("cpu")))
    made = with_looks(task.scene, learn_look(task).looks)
    seconds = process_time() - start
    write_scene(file, made)
    time.write_text(f"{seconds:.1f}")
    return made, seconds


def gallery(styles: list[str], vgg: Vgg) -> tuple[list[str], Likeness]:
    """Return the names and descriptions of the pictures of texgs, and of files among the styles."""
    files = [style for style in styles if style not in PICTURES]
    more = [picture_likeness(picture_of(file, "--styles").image, vgg) for file in files]
    parts = [style_likeness(), *([Likeness.stacked(more)] if more else [])]
    joined = Likeness(*(torch.cat([vars(part)[name] for part in parts]) for name in vars(parts[0])))
    return [*PICTURES, *(Path(file).name for file in files)], joined


def shown(scene: Scene) -> np.ndarray:
    """Return a small picture of a scene."""
    return frame(scene.open(), orbit(30, 20, *scene.framed().lens().square(SHOWN)), scene)


def left_of_data(scene: Scene, made: Scene, file: Path) -> dict[str, float]:
    """Return what is left of the data in a look, whose file is the third, and before it."""
    path = spiral(COUNTS["test"], scene.framed().lens().square(SIZE))
    both, opened = (scene, made), (scene.open(), made.open())
    measured = MeasuredScene("", both, opened, file, path, MEASURED, ("", ""), "", {}, [])
    legend, views = legend_colors(measured), [measured.frame(place) for place in measured.places]
    shares = shares_of(measured, 1, [*legend])
    told = [told_by_hue(*each, [*legend.values()], 0.0) for each in zip(views, shares, strict=True)]
    shown, seen = map(torch.cat, zip(*told, strict=True))
    return {"told_of_all": float((shown == seen).float().mean()), **values_of(measured, [METRIC])}


def rows_of(name: str, scene: Scene, changes: str, arguments: argparse.Namespace, vgg: Vgg) -> pd.DataFrame:
    """Return a row for each look of a scene by one setting."""
    styles = arguments.styles.split(",")
    names, pictures = gallery(styles, vgg)
    looks, rows = [], []
    for style in styles:
        folder = arguments.folder / name / (changes or "as-is") / Path(style).stem
        made, seconds = look(scene, style, changes, folder)
        seen = scene_likeness(made, made.open(), vgg)
        assert seen is not None
        far = seen.distances(pictures)
        values = {f"far_by_{kind}": dict(zip(names, x.tolist(), strict=True)) for kind, x in far.items()}
        looks.append((Path(style).name, values))
        if not (folder / "shown.png").exists():
            Image.fromarray(shown(made)).save(folder / "shown.png")
        row = {"scene": name, "settings": changes, "style": Path(style).name, "seconds": seconds}
        rows.append({**row, **left_of_data(scene, made, folder / "scene.yaml")})
        print(name, changes, style, seconds, flush=True)
    places = places_among(looks)
    return pd.DataFrame([{**row, **place} for row, place in zip(rows, places, strict=True)])


def sheet(arguments: argparse.Namespace, names: list[str], changes: str) -> Image.Image:
    """Draw all looks by one setting: a row a scene."""
    styles = [Path(style).stem for style in arguments.styles.split(",")]
    files = {name: arguments.folder / name / (changes or "as-is") for name in names}
    rows = {
        name: [np.asarray(Image.open(folder / style / "shown.png")) for style in styles]
        for name, folder in files.items()
    }
    return as_picture(lay_out(grid_rows(rows, styles)))


def main() -> None:
    """Measure, print shares, and write rows and sheets."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("scenes", nargs="+")
    parser.add_argument("--styles", default=",".join(PICTURES))
    parser.add_argument("--set", action="append", default=[], help="keys of edit.image, KEY=VALUE,...")
    arguments = parser.parse_args()
    vgg, tables = Vgg.load(layers=LAYERS), []
    scenes = {name: read_scene(file) for name, _, file in (each.partition("=") for each in arguments.scenes)}
    for changes in arguments.set or [""]:
        for name, scene in scenes.items():
            tables.append(rows_of(name, scene, changes, arguments, vgg))
            firsts = [(tables[-1][f"place_by_{kind}"] == 1).mean() for kind in ("colors", "pattern")]
            print(name, changes, "first by colours {:.0%}, by pattern {:.0%}".format(*firsts), flush=True)
        sheet(arguments, [*scenes], changes).save(arguments.folder / f"sheet-{changes or 'as-is'}.png")
    pd.concat(tables).to_csv(arguments.folder / "looks.csv", index=False)


if __name__ == "__main__":
    main()
