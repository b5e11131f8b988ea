"""One edit of six views against views that are edited again and again, by a guidance whose views disagree.

`python -m benchmarks.disagreement SURFELS GAUSSIANS VOXELS VIEWS OUTPUT` takes fitted models of one basic
scene in three fields and its views; it writes OUTPUT.csv and OUTPUT.png. Methods that iterate run longer and
longer.
"""

from __future__ import annotations

import csv
import time
from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from statistics import fmean
from typing import Any

import torch
from torch import Tensor

from benchmarks.command import call
from texgs.core.camera import Camera
from texgs.core.light import HEADLIGHT
from texgs.core.memory import keep_freed_memory
from texgs.core.plots import words
from texgs.edit.dataset_update import update_field
from texgs.edit.field_views import field_views
from texgs.edit.text import edit_by_text
from texgs.fields.field import Field
from texgs.fields.files import open_field
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.fit.settings import CommonRates
from texgs.methods import dge, igs2gs, in2n
from texgs.metrics.consistency import LONG, SHORT, SeenFrame, consistency
from texgs.metrics.sharpness import sharpness
from texgs.models.disagreement import Disagreeing
from texgs.models.filters.guidance import ProceduralFilters
from texgs.volume.images import Images, load
from texgs.volume.view_set import read_views

INSTRUCTION, AMOUNT = "pencil hatching", 0.1
RATES = CommonRates(1.6e-4, 0.001, 0.005, 0.05, 0.02, 0.001, 1.0, 1.0)
COLUMNS = ("method", "length", "seconds", "near", "far", "sharpness")


def main(surfels: str, gaussians: str, voxels: str, folder: str, output: str) -> None:
    """Run all methods with all lengths; write the table and the figure."""
    keep_freed_memory()
    views = read_views(folder)
    images, test = load(views.train), [view.camera for view in views.test]
    fitted = {"s": open_field(surfels), "g": open_field(gaussians), "v": open_field(voxels)}
    around = test[len(test) // 2 - 8 : len(test) // 2 + 8 + LONG]
    surfaces = [fitted["s"].render(camera, outputs=("median",)) for camera in around]
    rows = []
    for name, length, edit in runs(fitted, images):
        start = time.monotonic()
        edited = edit()
        seconds = time.monotonic() - start
        rows.append((name, length, seconds, *measures(edited, fitted["s"], around, surfaces)))
        print(*rows[-1])
    with Path(f"{output}.csv").open("w", newline="") as file:
        csv.writer(file, lineterminator="\n").writerows([COLUMNS, *rows])
    draw(rows, Path(f"{output}.png"))


def runs(fitted: dict[str, Any], images: Images) -> Iterator[tuple[str, float, Callable[[], Field]]]:
    """Name and length of each run, and the run."""
    guidance = Disagreeing(ProceduralFilters(), AMOUNT)

    def once(recipe: str) -> Field:
        cameras = images.cameras
        return edit_by_text(fitted["s"], cameras, guidance, INSTRUCTION, recipe, light=HEADLIGHT).model

    def again(module: Any, keys: Any, field: Field) -> Field:
        schedule = module.schedule(keys, len(images))
        learner = module.learner(keys, field, images, keys.closeness(torch.device("cpu")))
        renders = module is dge
        return update_field(learner, images, guidance, INSTRUCTION, schedule, keeps_renders=renders).field

    yield "one-shot, six views (ours)", 1, lambda: once("default")
    yield "one-shot, six views (paper's Adam)", 1, lambda: once("paper")
    for frozen in (False, True):
        twin = ", frozen" if frozen else ""
        for length in (1, 2, 4):
            grid = in2n.In2nKeys(lpips=0, every=5, density=1, sh=0.02, frozen=frozen, passes=length / 2)
            splats = igs2gs.Igs2gsKeys(every=150, rates=RATES, frozen=frozen, passes=length)
            some = dge.DgeKeys(lpips=0, every=100, rates=RATES, prune=False, frozen=frozen, rounds=length)
            yield f"IN2N{twin}", length / 2, partial(again, in2n, grid, fitted["v"])
            yield f"Instruct-GS2GS{twin}", length, partial(again, igs2gs, splats, fitted["g"])
            yield f"DGE{twin}", length, partial(again, dge, some, fitted["g"])


@torch.no_grad()
def measures(edited: Field, field: Field, cameras: list[Any], surfaces: list[Any]) -> tuple[float, ...]:
    """Consistency near and far, and sharpness against that of the guidance's own pictures of the field."""
    frames, ratios, filters = [], [], ProceduralFilters()
    for camera, surface in zip(cameras, surfaces, strict=True):
        image = painted(edited, camera).clamp(0, 1)
        frames.append(SeenFrame(image, surface.median, surface.alpha, camera))
    for camera, frame in list(zip(cameras, frames, strict=True))[::4]:
        views = field_views(field, [camera], frame.image[None])
        wanted = filters(views, INSTRUCTION, torch.Generator())[0]
        ratios.append(sharpness(frame.image, frame.alpha) / sharpness(wanted, frame.alpha))
    pairs = consistency(frames, (SHORT, LONG))
    return pairs[SHORT].rmse, pairs[LONG].rmse, fmean(ratios)


def painted(field: Field, camera: Camera) -> Tensor:
    """Colours [H, W, 3] as the guidance paints them, without light: that is what other fields learn."""
    if isinstance(field, Surfels):
        return Composition([field]).render(camera, look="unshaded").color
    return field.render(camera).color


def draw(rows: list[tuple[Any, ...]], path: Path) -> None:
    """Consistency and sharpness over seconds, a line for each method."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 4.4), dpi=120, layout="constrained")
    FigureCanvasAgg(figure)
    left, right = figure.subplots(1, 2)
    names = list(dict.fromkeys(row[0] for row in rows))
    colors = {name.removesuffix(", frozen"): f"C{index}" for index, name in enumerate(names[:5])}
    for name in names:
        own = [row for row in rows if row[0] == name]
        style = f"{'*' if 'one-shot' in name else 'o'}{'--' if 'frozen' in name else '-'}"
        for axes, column in ((left, 4), (right, 5)):
            over = [row[2] for row in own], [row[column] for row in own]
            axes.plot(*over, style, color=colors[name.removesuffix(", frozen")], label=words(name))
    left.set(xlabel="seconds", ylabel="RMSE of views seven apart", xscale="log", ylim=(0, None))
    right.set(xlabel="seconds", ylabel="sharpness against the guidance's", xscale="log", ylim=(0, None))
    figure.legend(*right.get_legend_handles_labels(), loc="outside lower center", ncols=4, fontsize=8)
    figure.savefig(path)


if __name__ == "__main__":
    call(main)
