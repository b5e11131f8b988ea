"""PSNR of scenes against their volumes under lights that shine from elsewhere.

`python -m benchmarks.relighting OUTPUT.json NAME=SCENE ...` compares each scene.yaml, with all of its models,
with the volume that it names, from the same random cameras and under the same lights: a headlight, lights
beside the camera and behind the object, and random ones.
"""

from __future__ import annotations

import json
import sys
from dataclasses import replace
from pathlib import Path
from statistics import fmean

import torch

from benchmarks import machine
from benchmarks.results import note
from texgs.core.camera import orbit
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT, Light, random_lights
from texgs.metrics.quality import compare
from texgs.scene.scene_file import read_scene
from texgs.scene.twin import Twin

SIZE, VIEWS, SEED = 400, 20, 1  # pixels of either side, cameras, and seed of these and of random lights
SIDE, BACK, ABOVE = 90.0, 150.0, 20.0  # degrees of azimuth from the camera, and above the horizon


def main(output: str, *scenes: str) -> None:
    """Measure all scenes, print means over the cameras, and write them."""
    measured = {}
    for name, _, source in (words.partition("=") for words in scenes):
        measured[name] = relit(Path(source))
        print(name, {light: round(scores["psnr"], 2) for light, scores in measured[name].items()})
    facts = {"machine": machine.describe(torch.device("cpu")), "size": SIZE, "views": VIEWS}
    Path(output).write_text(json.dumps({**facts, "scenes": measured}, indent=1) + "\n", encoding="utf-8")
    note(output, "benchmarks.relighting views surfels shading texture compose")


@torch.no_grad()
def relit(source: Path) -> dict[str, dict[str, float]]:
    """Return means over the cameras of what is measured of a scene, by light."""
    scene = read_scene(source)
    composed, twin = scene.open(), Twin(scene)
    lens = scene.frame.lens(width=SIZE, height=SIZE) if scene.frame else Lens().square(SIZE)
    places = [(light.azimuth, light.polar) for light in random_lights(VIEWS, SEED, 0)]
    lights = {
        "headlight": [HEADLIGHT] * VIEWS,
        "side": [Light("directional", azimuth + SIDE, ABOVE) for azimuth, _ in places],
        "back": [Light("directional", azimuth + BACK, ABOVE) for azimuth, _ in places],
        "random": random_lights(VIEWS, SEED, 1),
    }
    measured = {}
    for name, shine in lights.items():
        scores = []
        for place, light in zip(places, shine, strict=True):
            camera, lit = orbit(*place, *lens), replace(scene, light=light)
            scores.append(
                compare(composed.render(camera, light), twin.render(camera, lit, composed.palettes))
            )
        measured[name] = {key: fmean(each[key] for each in scores) for key in ("psnr", "ssim", "object_psnr")}
    return measured


if __name__ == "__main__":
    main(*sys.argv[1:])
