"""What a new transfer function with every frame costs the viewer, beside what the caster alone takes.

`python -m benchmarks.functions OUTPUT.json NAME=volume.nrrd ...` takes prepared volumes. It sends edits of a
page and asks for frames, in turns with casts of the same functions and pixels, in one process. Functions are
one or two random trapezoids; those that show less than half a percent of a picture do not count.
"""

from __future__ import annotations

import asyncio
import json
import math
import sys
from collections.abc import Iterator
from itertools import islice
from pathlib import Path
from statistics import median, quantiles
from tempfile import TemporaryDirectory
from time import perf_counter, process_time

import cv2
import numpy as np
import torch

from benchmarks import machine, scenes
from benchmarks.results import note
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import write_model
from texgs.fields.surfels.shading import ShadingModel, raw_material
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.session import Session
from texgs.scene.twin import SceneVolume, Twin
from texgs.viewer.frames import STEPS, Beside, Frames, Pace
from texgs.viewer.messages import View, parse
from texgs.viewer.origins import Origins
from texgs.viewer.shared_edits import Opened, SharedEdits
from texgs.volume.nrrd_file import open_grid
from texgs.volume.transfer import TransferFunction

WHOLE, MOVING = 400, 264  # pixels of a picture, and those of one that moves
COUNT, COVER, SEED = 24, 0.005, 1
NAME = "TF01"


def main(output: str, *volumes: str) -> None:
    """Measure all volumes, print the medians and write all figures."""
    measured = {}
    for name, _, file in (words.partition("=") for words in volumes):
        with machine.Load() as load, TemporaryDirectory() as folder:
            measured[name] = asyncio.run(dragged(Path(file), Path(folder)))
        measured[name]["load"] = str(load)
        print(name, measured[name])
    facts = {"machine": machine.describe(torch.device("cpu")), "whole": WHOLE, "moving": MOVING}
    Path(output).write_text(json.dumps({**facts, "volumes": measured}, indent=1) + "\n", encoding="utf-8")
    note(output, "benchmarks.functions texgs.viewer.frames texgs.viewer.shared_edits texgs.scene.twin")


async def dragged(file: Path, folder: Path) -> dict[str, object]:
    """Return milliseconds of frames and casts, and how close moving pictures are to whole ones."""
    grid, opened = open_grid(file), opened_scene(file, folder)
    session = Session(opened.scene)
    edits, frames = SharedEdits(session, opened), Frames(session, Beside(session, Origins(opened.scene)))
    random = np.random.default_rng(SEED)
    low, high = float(np.nanmin(grid.values)), float(np.nanmax(grid.values))
    times: dict[str, list[float]] = {"frame": [], "frame_cpu": [], "cast": [], "whole": []}
    closeness = []
    twin = Twin(opened.scene).with_step(STEPS["volume"], by_cell=False)
    for number, tf in enumerate(islice(functions(random, low, high), 4 * COUNT)):
        small, large = (view(number, size, size == MOVING) for size in (MOVING, WHOLE))
        message = {"type": "edit", "part": "", "key": "functions", "value": {NAME: tf.to_dict()}, "step": 1}
        words = json.dumps(message)
        start, cpu = perf_counter(), process_time()
        edits.change(parse(words), 0)
        packed = await frames.frame(small, edits.scene, Pace())
        took = {"frame": perf_counter() - start, "frame_cpu": process_time() - cpu}
        for key, own, asked in (("cast", twin, small), ("whole", None, large)):
            start = perf_counter()
            if own is None:
                whole = frames.pixels(asked, edits.scene)
            else:
                own._caster.cast(tf, asked.camera.camera(), edits.scene.light, by_cell=False)
            took[key] = perf_counter() - start
        if (whole != 255).any(axis=2).mean() < COVER:
            continue
        for key, seconds in took.items():
            times[key].append(1000 * seconds)
        closeness.append(psnr(enlarged(packed), whole))
        if len(closeness) == COUNT:
            break
    frames.close()
    return {
        "shape": list(grid.values.shape),
        "bytes": grid.values.nbytes,
        "functions": len(closeness),
        "ms": {key: {"median": median(ms), "90": quantiles(ms, n=10)[-1]} for key, ms in times.items()},
        "frame_to_cast": median(a / b for a, b in zip(times["frame"], times["cast"], strict=True)),
        "moving_db": {"mean": float(np.mean(closeness)), "tenth": float(np.quantile(closeness, 0.1))},
    }


def opened_scene(file: Path, folder: Path) -> Opened:
    """Return a scene of a volume as the viewer opens it; its model is small, and not seen."""
    parameters = scenes.surfels("light", 100)
    parameters["colors"] = parameters.pop("features")
    parameters |= raw_material(0.3, 0.7, 0.3, 20.0, "bounded")
    model = write_model(folder / "model.safetensors", Surfels(parameters, ShadingModel()))
    basic = TransferFunction([(0, 0), (1, 1)], [(0, 1, 1, 1)])
    scene = Scene({NAME: SceneModel(model)}, volume=SceneVolume(file, {NAME: basic}))
    return Opened(scene, folder / "scene.yaml", folder, "scene.yaml")


def functions(random: np.random.Generator, low: float, high: float) -> Iterator[TransferFunction]:
    """Yield random functions of values from `low` to `high`: one or two trapezoids of 3 to 30 % of them."""
    while True:
        count, points = random.integers(1, 3), list[tuple[float, float]]()
        for part in range(count):
            width = math.exp(random.uniform(math.log(0.03), math.log(0.3))) / count
            start = (part + random.uniform(0, 1 - count * width)) / count
            height = math.exp(random.uniform(math.log(0.03), math.log(0.9)))
            shape = zip((0, 0.3, 0.7, 1), (0, height, height, 0), strict=True)
            points += [(start + share * width, alpha) for share, alpha in shape]
        color = [(x, *random.uniform(0.1, 0.95, 3)) for x in (0.0, 0.5, 1.0)]
        yield TransferFunction(points, color).scaled(low, high)


def view(number: int, size: int, moving: bool) -> View:
    """Return what a page asks for on its way around a volume."""
    direction = {"azimuth": 15 * number % 360 - 180, "polar": 20, "distance": 4, "target": (0, 0, 0)}
    camera = {**direction, "fov_y": 30, "width": size, "height": size}
    asked = {"type": "view", "camera": camera, "mode": "volume"}
    return parse(json.dumps({**asked, "id": number, "moving": moving}))


def enlarged(packed: bytes) -> np.ndarray:
    """Return the picture of a frame as the page shows it [H, W, 3], uint8."""
    length = int.from_bytes(packed[:4], "little")
    picture = cv2.imdecode(np.frombuffer(packed[4 + length :], np.uint8), cv2.IMREAD_COLOR)
    return cv2.cvtColor(cv2.resize(picture, (WHOLE, WHOLE)), cv2.COLOR_BGR2RGB)


def psnr(image: np.ndarray, truth: np.ndarray) -> float:
    """Return how close two pictures are, dB."""
    return float(-10 * np.log10(max(np.mean((image / 255.0 - truth / 255.0) ** 2), 1e-10)))


if __name__ == "__main__":
    main(*sys.argv[1:])
