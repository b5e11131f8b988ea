"""PSNR of scenes against their volumes from closer than the views that they were fitted to.

`python -m benchmarks.framing OUTPUT.json NAME=SCENE ...` takes the same path for all scenes of a volume: a
spiral around what is visible, at half the distance from which that fills a view, under a headlight.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from statistics import fmean

import torch

from benchmarks import machine
from benchmarks.results import note
from texgs.core.io import read_json
from texgs.core.light import HEADLIGHT
from texgs.metrics.quality import compare
from texgs.scene.scene import Scene
from texgs.scene.scene_file import read_scene
from texgs.scene.twin import Twin
from texgs.volume.cameras import spiral

SIZE, VIEWS = 400, 24  # pixels of either side, and cameras
CLOSER = 0.5  # of the distance that frames what is visible
MEASURED = ("psnr", "ssim", "object_psnr", "object_ssim")


def main(output: str, *scenes: str) -> None:
    """Measure all scenes, print means over the cameras, and write them."""
    measured = {}
    for name, _, source in (words.partition("=") for words in scenes):
        scene = read_scene(source)
        measured[name] = {**fitted(scene), **closer(scene)}
        print(name, {key: round(value, 2) for key, value in measured[name].items()})
    facts = {"machine": machine.describe(torch.device("cpu")), "size": SIZE, "views": VIEWS, "closer": CLOSER}
    Path(output).write_text(json.dumps({**facts, "scenes": measured}, indent=1) + "\n", encoding="utf-8")
    note(output, "benchmarks.framing views surfels shading texture compose")


def fitted(scene: Scene) -> dict[str, float]:
    """Return the seconds that the fits of all models took, and their surfels."""
    folders = [entry.file.parent.parent for entry in scene.models.values()]
    jobs = [read_json(path) for folder in folders for path in sorted(folder.glob("*/metrics.json"))]
    return {"seconds": sum(job["seconds"] for job in jobs), "surfels": len(scene.open())}


@torch.no_grad()
def closer(scene: Scene) -> dict[str, float]:
    """Return means over the cameras of what is measured of a scene."""
    composed, twin = scene.open(), Twin(scene)
    lens = scene.framed(composed).lens(width=SIZE, height=SIZE)
    scores = [
        compare(composed.render(camera, HEADLIGHT), twin.render(camera, scene, composed.palettes))
        for camera in spiral(VIEWS, lens._replace(radius=CLOSER * lens.radius))
    ]
    return {name: fmean(each[name] for each in scores) for name in MEASURED}


if __name__ == "__main__":
    main(*sys.argv[1:])
