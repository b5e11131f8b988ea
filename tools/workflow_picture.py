"""Draw the workflow, from a volume to tables, with pictures from the results of the demo."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import nrrd
import numpy as np
from PIL import Image

from texgs.config.compose import compose
from texgs.core.camera import orbit
from texgs.core.figures import as_picture, new_figure
from texgs.core.io import read_json
from texgs.report.given_row import tf_plot
from texgs.scene.frame import frame
from texgs.scene.scene_file import read_scene
from texgs.volume.basic_tfs import basic_tfs_of

LINE = {"color": "0.35", "linewidth": 1.2}
TF, SIZE = "TF02", 280  # of the models shown alone, and pixels of pictures
WIDTH, DPI = 11.0, 110  # inches, dots per inch
CELL, STEP, LEFT = 1.4, 1.8, 0.3  # inches: a picture, from one to the next, and before the first
TOPS = 0.72, 3.34  # of pictures, from above
HEIGHT = 5.27
GOLD, CRIMSON = "edits/gold/scene.yaml", "edits/crimson/scene.yaml"
BANDS = (
    ("#eaf2fb", "Scene representation: each basic transfer function is fitted by itself"),
    ("#fdf1e4", "Scene editing: geometry stays as it was fitted"),
)


@dataclass(frozen=True)
class Step:
    """A picture with what it shows."""

    title: str
    words: str
    pixels: np.ndarray | None = None  # [H, W, 3]
    table: Sequence[Sequence[str]] = ()  # in its place
    arrow: str = "→"  # to the next one


def draw(run: Path) -> Image.Image:
    """Draw both stages, one below the other; `run` has the results of the demo."""
    figure = new_figure(WIDTH, HEIGHT, DPI, layout=None)
    axes = figure.add_axes((0, 0, 1, 1))
    axes.set_axis_off()
    rows = representation(run / "orbital"), editing(run / "orbital/scene/demo")
    for steps, top, (color, words) in zip(rows, TOPS, BANDS, strict=True):
        band = (0.1, WIDTH - 0.1), top - 0.6, top + CELL + 0.45
        axes.fill_between(*band, color=color, linewidth=0, zorder=-1)
        axes.text(LEFT, top - 0.42, words, size=9, va="center", color="0.35")
        for index, step in enumerate(steps):
            draw_step(axes, step, LEFT + index * STEP, top)
    axes.set(xlim=(0, WIDTH), ylim=(HEIGHT, 0))
    start, end = (LEFT + 5 * STEP + CELL / 2, TOPS[0] + CELL + 0.4), (0.15, TOPS[1] + CELL / 2)
    between = (TOPS[0] + CELL + 0.45 + TOPS[1] - 0.6) / 2
    axes.plot([start[0], start[0], end[0], end[0]], [start[1], between, between, end[1]], **LINE)
    arrow(axes, end, (LEFT, end[1]))
    return as_picture(figure)


def draw_step(axes: Any, step: Step, left: float, top: float) -> None:
    """Draw a picture or a small table with its title above, its words below, and the arrow behind it."""
    right, bottom, middle = left + CELL, top + CELL, top + CELL / 2
    axes.text(left + CELL / 2, top - 0.08, step.title, ha="center", va="bottom", size=10, weight="bold")
    for line, words in enumerate(step.words.splitlines()):
        axes.text(left + CELL / 2, bottom + 0.18 + 0.14 * line, words, ha="center", size=8)
    if step.pixels is not None:
        extent = (left, right, bottom, top)
        axes.imshow(step.pixels, extent=extent, aspect="auto", interpolation="antialiased")
    face = "white" if step.table else "none"
    axes.fill_between((left, right), top, bottom, facecolor=face, edgecolor="0.6")
    for line, cells in enumerate(step.table):
        weight = "bold" if cells[-1] in ("SSIM", "RMSE") else "normal"
        for column, cell in enumerate(cells):
            place = left + 0.1 + column * (CELL - 0.1) / len(cells), top + 0.14 + line * 0.187
            axes.text(*place, cell, size=7, va="center", weight=weight)
    if step.arrow == "→":
        arrow(axes, (right + 0.05, middle), (left + STEP - 0.05, middle))
    elif step.arrow:
        between = (right + left + STEP) / 2
        axes.text(between, middle, step.arrow, ha="center", va="center", size=9, color="0.35")


def arrow(axes: Any, start: tuple[float, float], end: tuple[float, float]) -> None:
    """Draw an arrow between two places."""
    style = {"arrowstyle": "-|>", "shrinkA": 0, "shrinkB": 0, **LINE}
    axes.annotate("", end, start, arrowprops=style)


def representation(folder: Path) -> list[Step]:
    """Return the way from a volume to a textured model of one basic transfer function."""
    volume, dataset = folder / "volume/volume.nrrd", compose(("dataset=orbital",)).dataset
    values = nrrd.read(str(volume))[0]
    middle = values[values.shape[0] // 2][::-1]  # +y up
    grey = (255 * (middle - values.min()) / np.ptp(values)).astype(np.uint8)
    plot = tf_plot(volume, basic_tfs_of(volume, dataset.basic_tfs, dataset.tf_values))
    show = partial(rendered, folder / "scene/demo/compose/scene.yaml", only=TF)
    sheet = contact_sheet(folder / TF / "views/train")
    return [
        Step("volume", "values on a grid", np.repeat(grey[..., None], 3, axis=2), arrow="+"),
        Step("basic TFs", "colours and opacities\nof ranges of values", plot),
        Step("views", "ray-cast from all sides,\nwith their cameras", sheet),
        Step("surfels", "flat 2D Gaussians, placed\non what is visible", show(mode="discs")),
        Step("shading", "normals and a material\nfor Blinn-Phong", show(mode="normal")),
        Step("texture", "a palette colour,\nand texels on surfels", show(), arrow=""),
    ]


def editing(folder: Path) -> list[Step]:
    """Return what becomes of the scene of all models."""
    table = [("", "PSNR", "SSIM")]
    for name in ("TF01", "TF02"):
        numbers = read_json(folder.parents[1] / name / "demo/texture/metrics.json")["numbers"]
        table.append((name, f"{numbers['psnr']:.1f}", f"{numbers['ssim']:.3f}"))
    table += [("",), ("edit", "MB", "RMSE")]
    for name in ("glass", "gold"):
        numbers = read_json(folder / "edit_metrics" / name / "metrics.json")["numbers"]
        table.append((name, f"{numbers['megabytes']:.1f}", f"{numbers['short_rmse']:.3f}"))
    files = ("compose/scene.yaml", "pse/pse-2.yaml", GOLD, CRIMSON)
    edited = {file: rendered(folder / file) for file in files}
    return [
        Step("scene", "all models together:\na small text file", edited["compose/scene.yaml"]),
        Step("by numbers", "colour, opacity, light,\nin every frame", edited["pse/pse-2.yaml"], arrow="or"),
        Step("by a picture", "texels follow\nits style", with_inset(folder), arrow="or"),
        Step("by words", "“turn it into gold”:\ntexels follow edited views", edited[GOLD], arrow="or"),
        Step("in parts", "segments by clicks,\neach with its own look", edited[CRIMSON]),
        Step("measures", "tables, figures and\na report in one file", table=table, arrow=""),
    ]


def rendered(scene_file: Path, mode: Any = "shaded", only: str = "") -> np.ndarray:
    """Return a scene, or one of its models, [H, W, 3]."""
    scene = read_scene(scene_file)
    if only:
        scene = replace(scene, models={only: scene.models[only]})
    camera = orbit(30, 20, *scene.framed().lens().square(SIZE))
    return frame(scene.open(), camera, scene, mode)


def contact_sheet(folder: Path) -> np.ndarray:
    """Return four views [H, W, 3] of a folder."""
    files, tiles = sorted(folder.glob("*.png")), []
    for file in files[:: len(files) // 4][:4]:
        view = Image.open(file).convert("RGBA")
        white = Image.new("RGBA", view.size, "white")
        tiles.append(np.asarray(Image.alpha_composite(white, view).convert("RGB")))
    return np.vstack([np.hstack(tiles[:2]), np.hstack(tiles[2:])])


def with_inset(folder: Path) -> np.ndarray:
    """Return the scene in stained glass, with its style in a corner."""
    image = Image.fromarray(rendered(folder / "edits/glass/scene.yaml"))
    style = Image.open(folder / "edits/glass/style.png").convert("RGB").resize((70, 70))
    image.paste(style, (image.width - 75, image.height - 75))
    return np.asarray(image)
