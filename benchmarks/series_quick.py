"""Quality of the steps of a series beside models of the recipe `quick` that are fitted to them alone.

`python -m benchmarks.series_quick OUTPUT.json FOLDER [SERIES ...]` takes the steps that `benchmarks.series`
has left in a folder, fits `quick` to the volumes of each tenth one and the last, at its size, and compares
both with the volumes on its test views. Fits are kept in the folder and not made again. Nothing is timed.
"""

from __future__ import annotations

import json
from pathlib import Path
from statistics import fmean

import torch

import texgs
from benchmarks import machine
from benchmarks.command import call
from benchmarks.series import LOOK, SAMPLES, SIZE, STEPS, TFS, compared, quality
from texgs.core.errors import ArgumentError
from texgs.fields.surfels.compact import write_compact
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import read_model
from texgs.fields.surfels.step_file import at_step
from texgs.volume.generate_series import SERIES
from texgs.volume.generate_series import series as made
from texgs.volume.grid import Grid

RECIPE = "quick"


def main(output: str, folder: str, *names: str) -> None:
    """Compare series, and write what was found."""
    found = {name: series(name, Path(folder) / name) for name in names or SERIES}
    facts = {"machine": machine.describe(torch.device("cpu")), "recipe": RECIPE, "series": found}
    Path(output).write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")


def series(name: str, folder: Path) -> dict:
    """Return rows of the steps of one series that are compared, and their means."""
    grids, key, rows = made(name, SAMPLES, STEPS), read_model(folder / "finer-0.safetensors"), {}
    for step in compared()[1:]:
        file = folder / f"step-{step}.safetensors"
        alone, surfels = fitted(grids[step], name, folder / f"{RECIPE}-{step}")
        packed = write_compact(folder / f"{RECIPE}-{step}.texgs", alone)
        rows[step] = {
            "psnr": quality(at_step(key, file), grids[step], TFS[name]),
            "quick_psnr": quality(alone, grids[step], TFS[name]),
            "bytes": file.stat().st_size,
            "quick_compact_bytes": packed.stat().st_size,
            "quick_bytes": surfels.stat().st_size,
            "quick_surfels": len(alone),
        }
        print(name, step, rows[step], flush=True)
    means = {part: fmean(row[part] for row in rows.values()) for part in ("psnr", "quick_psnr")}
    return {"steps": rows, "mean": {**means, "below": means["quick_psnr"] - means["psnr"]}}


def fitted(grid: Grid, name: str, folder: Path) -> tuple[Surfels, Path]:
    """Return a model that is fitted to the volume of one step, and its file."""
    volume = texgs.Volume(grid.values, name=name)
    scene = texgs.fit(volume, {name: TFS[name]}, RECIPE, size=SIZE, folder=folder).session.scene
    if scene.volume is None or scene.volume.appearance != LOOK:
        raise ArgumentError("expected views of the look that models are compared under")
    file = scene.models[name].file
    return read_model(file), file


if __name__ == "__main__":
    call(main, "benchmarks.series_quick views surfels shading texture compose texgs.fitting.series")
