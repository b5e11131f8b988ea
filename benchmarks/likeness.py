"""How much of a style edits carry over: measures in views not learned from, and a contact sheet of them.

`python -m benchmarks.likeness --help`; needs the weights of VGG-16 up to relu4_3.
"""

from __future__ import annotations

import argparse
import csv
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
import yaml
from torch import Tensor
from torch.nn import functional as F

from texgs.core.camera import Camera
from texgs.core.image import write_png
from texgs.core.light import Light
from texgs.edit.methods.style import picture_of
from texgs.edit.recipe import Recipe, preset
from texgs.edit.style_picture import StylePicture
from texgs.edit.stylize import stylize
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import read_model
from texgs.metrics.style import ON_OBJECT, gram, likeness, mean
from texgs.models.vgg import Vgg
from texgs.volume.reduced import smaller
from texgs.volume.view_set import View, read_views

DEEP = ("relu4_1", "relu4_2", "relu4_3")  # layers that no loss looks at
STRIDE = 8  # pixels between the positions of their features
HELD_OUT = 4  # test views that are measured; the second of them is on the sheet
CELL = 180  # pixels of a picture on the sheet
FITTED = "fitted"  # in place of a recipe: no edit


@dataclass(frozen=True, eq=False)
class Scene:
    """A model, the views that edits learn from, and views that they do not."""

    name: str
    model: Surfels
    train: Sequence[View]
    held: Sequence[View]
    reduce: int

    @classmethod
    def read(cls, text: str) -> Scene:
        """From NAME=MODEL,VIEWS[,REDUCE]: the file of a textured model and the folder of its views."""
        name, _, rest = text.partition("=")
        model, folder, *reduce = rest.split(",")
        views = read_views(folder)
        held = [views.test[int((i + 0.5) * len(views.test) / HELD_OUT)] for i in range(HELD_OUT)]
        return cls(name, read_model(model), views.train, held, int(reduce[0]) if reduce else 1)

    def cameras(self, views: Sequence[View]) -> tuple[list[Camera], list[Light]]:
        """Cameras and lights of views, at the size at which they are looked at."""
        return [smaller(view.camera, self.reduce) for view in views], [view.light for view in views]


@torch.no_grad()
def deep_gram(model: Surfels, cameras: list[Camera], lights: list[Light], style: Tensor, vgg: Vgg) -> float:
    """Distance of the Gram matrices of layers that nothing optimises, as `Likeness.gram`."""
    target, distances = gram(vgg.features(style)), []
    for camera, light in zip(cameras, lights, strict=True):
        shown = model.render(camera, light)
        on = F.avg_pool2d(shown.alpha[None], STRIDE)[0] > ON_OBJECT
        seen = vgg.features(shown.color.clamp(0, 1).permute(2, 0, 1))
        distances.append(float((gram(seen[:, on]) - target).norm() / target.norm()))
    return mean(distances)


def measured(
    scene: Scene, style: StylePicture, recipe: Recipe | None, networks: tuple[Vgg, Vgg]
) -> tuple[dict[str, Any], Tensor]:
    """Likeness after an edit, or without any, with its CPU seconds, and a picture [3, CELL, CELL] of it."""
    begin, edited = time.process_time(), scene.model
    if recipe is not None:
        edited = stylize(scene.model, *scene.cameras(scene.train), style, recipe, vgg=networks[0]).model
    seconds = time.process_time() - begin
    cameras, lights = scene.cameras(scene.held)
    scaled = style.scaled(max(cameras[0].width, cameras[0].height)).image
    scores = likeness(edited, cameras, lights, scaled, networks[0])
    numbers = {
        "cpu_seconds": round(seconds, 1),
        "nnfm": round(scores.nnfm, 3),
        "gram": round(scores.gram, 3),
        "deep": round(deep_gram(edited, cameras, lights, scaled, networks[1]), 3),
        "color": round(max(map(abs, scores.color)), 3),
    }
    return numbers, picture(edited, cameras[1], lights[1])


@torch.no_grad()
def picture(model: Surfels, camera: Camera, light: Light) -> Tensor:
    """What shows of a model [3, CELL, CELL], cut to the object."""
    shown = model.render(camera, light)
    rows, columns = (shown.alpha > 0.02).nonzero().unbind(1)
    side = int(max(rows.max() - rows.min(), columns.max() - columns.min())) + 9
    top, left = (max(0, int(x.min() + x.max() - side) // 2) for x in (rows, columns))
    part = shown.color[top : top + side, left : left + side].clamp(0, 1).permute(2, 0, 1)
    return F.interpolate(part[None], (CELL, CELL), mode="area")[0]


def recipe_of(text: str) -> Recipe | None:
    """A recipe from NAME[:FIELD=VALUE,...]; None for FITTED."""
    name, _, changes = text.partition(":")
    return None if name == FITTED else preset(name, **yaml.safe_load(f"{{{changes.replace('=', ': ')}}}"))


def main() -> None:
    """Edit every scene with every style and recipe; a row of the CSV file and of the sheet for each."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenes", nargs="+", type=Scene.read, metavar="NAME=MODEL,VIEWS[,REDUCE]")
    parser.add_argument("--styles", nargs="+", required=True, metavar="NAME|FILE")
    parser.add_argument("--recipes", nargs="+", required=True, metavar=f"{FITTED}|NAME[:FIELD=VALUE,...]")
    parser.add_argument("--csv", type=Path, required=True)
    parser.add_argument("--sheet", type=Path, help="PNG file: a row for each style, recipes of scenes beside")
    given = parser.parse_args()
    networks, rows, sheet = (Vgg.load(), Vgg.load(layers=DEEP)), [], []
    for style in given.styles:
        source = picture_of(style, "--styles")
        line = [F.interpolate(source.image[None], (CELL, CELL), mode="area")[0]]
        for scene in given.scenes:
            for text in given.recipes:
                numbers, shown = measured(scene, source, recipe_of(text), networks)
                rows.append({"views": scene.name, "style": Path(style).stem, "recipe": text, **numbers})
                print(*rows[-1].values(), flush=True)
                line.append(shown)
        sheet.append(torch.cat(line, dim=2))
    with given.csv.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    if given.sheet:
        write_png(given.sheet, torch.cat(sheet, dim=1).permute(1, 2, 0))


if __name__ == "__main__":
    main()
