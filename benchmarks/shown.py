"""Whether fits lose anything that volumes show: the share that they show, and pieces that are missing.

`python -m benchmarks.shown OUTPUT.csv SIZE VOLUME...` fits the suggested functions of volumes, files that
`texgs.Volume` reads, by `quick` in views of a size, up to the phase `shading`, as textures leave alpha alone.
In 20 test views it looks for pieces: neighbouring pixels, more than one, in which the volume is more than
half opaque and the model less than a quarter. Those with more than 0.05 % of the pixels that show anything of
the volume count as missing. A row is written when it is measured.
"""

from __future__ import annotations

import csv
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from scipy.ndimage import label

import texgs
from benchmarks.command import call
from texgs.api.fit import configuration
from texgs.core.io import read_json
from texgs.core.names import METRICS
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import read_model
from texgs.metrics.quality import VISIBLE
from texgs.volume.images import over_white
from texgs.volume.view_set import View, read_views
from texgs.workflow.execution import Task, ensure
from texgs.workflow.stage import made
from texgs.workflow.stage_table import STAGES, jobs

VIEWS = 20
OPAQUE, CLEAR = 0.5, 0.25  # alpha
SMALL = 5e-4  # of the pixels of an object: smaller pieces do not count
NEIGHBOURS = np.ones((3, 3), int)
PIECES = ("missing_pieces", "largest_piece_percent", "largest_piece_pixels")
TOLD = ("primitives", "psnr", "object_psnr", "ssim", "shown")


def main(output: str, size: str, *volumes: str) -> None:
    """Measure volumes, and write a row for each function."""
    with Path(output).open("w", encoding="utf-8", newline="") as file:
        table = csv.writer(file, lineterminator="\n")
        table.writerow(("volume", "function", "size", *TOLD, *PIECES))
        for volume in volumes:
            for row in rows(texgs.Volume(volume), int(size)):
                print(*row, flush=True)
                table.writerow(row)
                file.flush()


def rows(volume: texgs.Volume, size: int) -> Iterator[tuple[object, ...]]:
    """Fit all functions of a volume, and yield what is told of each."""
    few = (f"views.test.count={VIEWS}", "views.relit=0", "views.turntable=1", f"views.width={size}")
    with TemporaryDirectory(prefix="texgs-") as folder:
        words = ("fit=quick", *few, f"views.height={size}")
        config = configuration(volume, dict(volume.suggest()), words, Path(folder))
        known = {stage.output(each): Task(stage, each) for stage, each in jobs(config)}
        for name in config.dataset.basic_tfs:
            own = replace(config, tf=name)
            ensure(STAGES["shading"], own, known, tell=lambda line: None)
            model = made("phase", own, "shading")
            numbers = read_json(model.with_name(METRICS))["numbers"]
            pieces = missing(read_model(model), read_views(made("views", own).parent).test)
            counted = [share for pixels, share in pieces if pixels > 1 and share > SMALL]
            pixels, share = max(pieces, default=(0, 0.0))
            told = [*(round(numbers[key], 4) for key in TOLD), len(counted), round(100 * share, 4), pixels]
            yield volume.name, name, size, *told


@torch.no_grad()
def missing(model: Surfels, views: list[View]) -> list[tuple[int, float]]:
    """Return of all pieces that are missing in views the pixels, and their share of the object's pixels."""
    found: list[tuple[int, float]] = []
    for view in views:
        truth = over_white(view, 1)[3]
        alpha = model.render(view.camera, view.light).alpha
        pieces, _ = label(((truth > OPAQUE) & (alpha < CLEAR)).numpy(), NEIGHBOURS)
        seen = float((truth > VISIBLE).sum())
        found += [(size, size / seen) for size in np.bincount(pieces.ravel())[1:].tolist()]
    return found


if __name__ == "__main__":
    call(main, "views surfels shading benchmarks.shown")
