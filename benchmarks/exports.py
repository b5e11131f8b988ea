"""How far scenes are from what other programs make of their exports: PSNR against `texgs render`.

`python -m benchmarks.exports OUTPUT.csv NAME=SCENE,...` opens each file again with the readers of the tests
and draws it by the kernel that its format states: surfels as texgs does, others with the filter of 3DGS.
"""

from __future__ import annotations

from pathlib import Path
from statistics import fmean
from tempfile import TemporaryDirectory

import pandas as pd
import torch

from benchmarks.command import call
from tests.scene.cloud_files import READERS, drawn
from texgs.core.light import HEADLIGHT
from texgs.core.names import EXPORTS
from texgs.fields.files import open_field
from texgs.fields.part_edit import PartEdit
from texgs.metrics.quality import psnr
from texgs.scene.clouds import Cloud, cloud_of
from texgs.scene.export import Export, export_scene
from texgs.scene.scene import Scene
from texgs.scene.scene_file import read_scene
from texgs.volume.cameras import spiral

SIZES, VIEWS = (400, 800), 24  # pixels of either side, and cameras
KINDS = ("2dgs", "3dgs", "usd", "gltf", "spz")


def main(output: str, scenes: str) -> None:
    """Measure, print and write a row for each scene, kind and size."""
    named = (words.partition("=")[::2] for words in scenes.split(","))
    rows = [{"data": name, **row} for name, file in named for row in measured(read_scene(file))]
    table = pd.DataFrame(rows).round(3)
    print(table.to_string(index=False))
    table.to_csv(output, index=False, lineterminator="\n")


@torch.no_grad()
def measured(scene: Scene) -> list[dict[str, object]]:
    """Return PSNRs of all kinds of file, by the mean and the least of the views, and their bytes."""
    composed, background, rows = scene.open(), torch.tensor(scene.background), []
    for size in SIZES:
        cameras = spiral(VIEWS, scene.framed(composed).lens(width=size, height=size))
        shown = [composed.render(each, scene.light, scene.edits, background=background) for each in cameras]
        for kind in KINDS:
            clouds, n_bytes = written(scene, kind)
            views = (drawn(clouds, camera, scene.background) for camera in cameras)
            scores = [psnr(view, own.color.clamp(0, 1)) for view, own in zip(views, shown, strict=True)]
            found = {"psnr": fmean(scores), "least": min(scores), "bytes": n_bytes}
            rows.append({"kind": kind, "pixels": f"{size}x{size}", **found})
    return rows


def written(scene: Scene, kind: str) -> tuple[list[Cloud], int]:
    """Return what is in the file of a scene, and its size."""
    with TemporaryDirectory() as folder:
        path = export_scene(Path(folder, f"scene{EXPORTS[kind][0]}"), scene, Export(kind))
        if path.suffix in READERS:
            return READERS[path.suffix](path), path.stat().st_size
        cloud = cloud_of(kind, (open_field(path), []), [PartEdit()], HEADLIGHT)
        return [cloud], path.stat().st_size


if __name__ == "__main__":
    call(main, "benchmarks.exports surfels shading texture compose")
