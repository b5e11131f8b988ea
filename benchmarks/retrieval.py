"""Whether a person would name the picture of a look: its place among many, over scenes, styles and recipes.

`python -m benchmarks.retrieval FOLDER SCENE... --styles glass,...,FILE --recipes default,preview` gives each
scene each style, and prints the share of looks whose own picture is the nearest, with colours and by the
pattern. Edited scenes stay in the folder, and a run goes on where it stopped. Pictures are those of texgs and
the files named. The mean over the looks of one scene and recipe is taken from the distances to a picture. It
needs VGG-16.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from statistics import fmean
from time import monotonic

import torch

from texgs.core.errors import ArgumentError
from texgs.edit.keys import EditKeys
from texgs.edit.methods.image import ImageKeys, run
from texgs.edit.methods.style import picture_of
from texgs.metrics.edits.retrieval import places_among
from texgs.metrics.retrieval import LAYERS, Likeness, known, scene_likeness
from texgs.models.pictures import PICTURES
from texgs.models.vgg import Vgg
from texgs.scene.scene import Scene
from texgs.scene.scene_file import read_scene, write_scene
from texgs.viewer.looks import OrbitTask
from tools.style_likeness import picture_likeness

CPU = torch.device("cpu")


def edited(scene: Scene, style: str, recipe: str, opacity: str, folder: Path) -> tuple[Scene, float]:
    """Return a scene in a style, and the seconds that it took; 0 where it is there already."""
    file = folder / "scene.yaml"
    if file.exists():
        return read_scene(file), 0.0
    folder.mkdir(parents=True, exist_ok=True)
    lens = scene.framed().lens().square(400)
    keys = ImageKeys(style=style, recipe=recipe, opacity=opacity)
    start = monotonic()
    made = run(OrbitTask(keys, EditKeys("look"), scene, {}, folder, CPU, 1, lens, folder.name)).scene
    write_scene(file, made)
    return made, monotonic() - start


def gallery(files: list[str], vgg: Vgg) -> tuple[list[str], Likeness]:
    """Return the names and descriptions of the pictures of texgs and of files."""
    own, more = known(), [picture_likeness(picture_of(file, "--styles").image, vgg) for file in files]
    parts = [own, *([Likeness.stacked(more)] if more else [])]
    joined = Likeness(*(torch.cat([vars(part)[name] for part in parts]) for name in vars(own)))
    return [*PICTURES, *(Path(file).name for file in files)], joined


def rows_of(arguments: argparse.Namespace, vgg: Vgg) -> list[dict[str, object]]:
    """Return a row for each look of each scene by each recipe."""
    styles = arguments.styles.split(",")
    names, pictures = gallery([style for style in styles if style not in PICTURES], vgg)
    rows = []
    for file in arguments.scenes:
        scene = read_scene(file)
        title = f"{file.resolve().parts[-5:][0]} {'+'.join(scene.models)}"
        for recipe in arguments.recipes.split(","):
            looks, told = [], []
            for style in styles:
                folder = (
                    arguments.folder
                    / title.replace(" ", "-")
                    / f"{Path(style).stem}-{recipe}-{arguments.opacity}"
                )
                made, seconds = edited(scene, style, recipe, arguments.opacity, folder)
                seen = scene_likeness(made, made.open(), vgg)
                if seen is None:
                    raise ArgumentError(f"{folder}: expected a scene that shows something, got nothing")
                far = seen.distances(pictures)
                values = {
                    f"far_by_{kind}": dict(zip(names, x.tolist(), strict=True)) for kind, x in far.items()
                }
                looks.append((Path(style).name, values))
                lifts = " ".join(f"{model.edit.opacity:g}" for model in made.models.values())
                told.append({"scene": title, "recipe": recipe, "style": Path(style).name, "opacity": lifts})
                print(title, recipe, style, lifts, f"{seconds:.1f} s", flush=True)
            for row, places in zip(told, places_among(looks), strict=True):
                firsts = {key.replace("place", "first"): int(place == 1) for key, place in places.items()}
                rows.append({**row, **places, **firsts})
    return rows


def main() -> None:
    """Measure, print shares and write all rows as CSV."""
    import pandas as pd

    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path)
    parser.add_argument("scenes", type=Path, nargs="+")
    parser.add_argument("--styles", default=",".join(PICTURES))
    parser.add_argument("--recipes", default="default")
    parser.add_argument("--opacity", default="auto", help="see edit.image.opacity")
    parser.add_argument("--output", type=Path)
    arguments = parser.parse_args()
    rows = rows_of(arguments, Vgg.load(layers=LAYERS))
    for key in sorted({(str(row["scene"]), str(row["recipe"])) for row in rows}):
        own = [row for row in rows if (row["scene"], row["recipe"]) == key]
        shares = [fmean(row.get(f"first_by_{kind}", 0) for row in own) for kind in ("colors", "pattern")]
        print(*key, f"{len(own)} looks: first by colours {shares[0]:.0%}, by the pattern {shares[1]:.0%}")
    if arguments.output:
        pd.DataFrame(rows).to_csv(arguments.output, index=False)


if __name__ == "__main__":
    main()
