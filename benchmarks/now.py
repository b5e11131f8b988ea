"""Seconds and quality of models that are fitted while somebody waits, beside those of the workflow.

`python -m benchmarks.now OUTPUT.json SCENE` fits each basic transfer function of a scene.yaml of the workflow
anew, at the size of its test views, and compares all models with these and with those under other lights.
Processor seconds of all threads are measured beside those of a clock.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from time import perf_counter, process_time

import torch

from benchmarks import machine
from benchmarks.command import call
from texgs.fields.surfels.model import Surfels
from texgs.fitting.now import fit_now
from texgs.metrics.quality import evaluate, mean
from texgs.scene.scene_file import read_scene
from texgs.viewer.origins import find_upwards
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.nrrd_file import open_grid
from texgs.volume.view_set import View, read_views

EVERY = 8  # test view that counts


def main(output: str, source: str) -> None:
    """Measure all models of a scene, and write what was measured."""
    measured = {}
    scene = read_scene(source)
    volume = scene.volume
    assert volume is not None, "the workflow names it"
    for name, entry in scene.models.items():
        folder = find_upwards(entry.file, "views/transforms_train.json")
        assert folder is not None, "views lie beside their model"
        views = read_views(folder.parent)
        splits = {"test": views.test[::EVERY], "relit": views.relit}
        with machine.Load() as load:
            rows = {"workflow": {"surfels": len(entry.open()[0]), **quality(entry.surfels()[0], splits)}}
            camera = views.test[0].camera
            seconds, processor = 0.0, 0.0
            start, busy = perf_counter(), process_time()
            grid = open_grid(volume.file)
            lens = frame_of(grid, [volume.tfs[name]]).lens(width=camera.width, height=camera.height)
            caster = Caster(grid, volume.appearance)
            for number, model in enumerate(fit_now(caster, volume.appearance, volume.tfs[name], lens, name)):
                seconds += perf_counter() - start
                processor += process_time() - busy
                took = {"seconds": seconds, "processor_seconds": processor, "surfels": len(model)}
                rows["finer" if number else "first"] = {**took, **quality(model, splits)}
                start, busy = perf_counter(), process_time()
        measured[name] = {**rows, "load": str(load)}
        print(name, measured[name])
    facts = {"machine": machine.describe(torch.device("cpu")), "models": measured}
    Path(output).write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")


def quality(model: Surfels, splits: dict[str, Sequence[View]]) -> dict[str, float]:
    """Return the PSNR and SSIM of each split."""
    scores = {}
    with torch.no_grad():
        for split, views in splits.items():
            of_split = mean(evaluate(model, list(views), 1, split))
            scores |= {f"{split}_{key}": of_split[key] for key in ("psnr", "ssim", "object_psnr")}
    return scores


if __name__ == "__main__":
    call(main, "benchmarks.now texgs.fitting.now")
