"""Seconds, quality and bytes of the steps of a series, beside models that are fitted to them alone.

`python -m benchmarks.series OUTPUT.json FOLDER [SERIES ...]` makes the generated series, fits a model to the
first step of each by `fit_now`, follows it through all steps, and compares each tenth step with models of
`fit_now` of that step, first and finer, on test views of 400 x 400 that neither was fitted to. Models of
`fit_now` are kept in the folder and not fitted again. Processor seconds of all threads are measured beside
those of a clock.
"""

from __future__ import annotations

import json
from pathlib import Path
from statistics import fmean
from time import perf_counter, process_time

import torch

from benchmarks import machine
from benchmarks.command import call
from texgs.core.io import read_json, write_json
from texgs.core.lens import Lens
from texgs.core.light import HEADLIGHT
from texgs.fields.surfels.compact import write_compact
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.model_file import read_model, write_model
from texgs.fields.surfels.step_file import at_step, write_step
from texgs.fitting.now import fit_now
from texgs.fitting.series import Follower
from texgs.metrics.quality import psnr
from texgs.volume.cameras import spiral
from texgs.volume.caster import Caster
from texgs.volume.framing import frame_of
from texgs.volume.generate_series import SERIES
from texgs.volume.generate_series import series as made
from texgs.volume.grid import Grid
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction

SAMPLES, STEPS, SIZE, VIEWS, EVERY = 96, 20, 400, 12, 10
LOOK = Appearance()
TFS = {
    "rings": TransferFunction(
        ((0.12, 0.0), (0.3, 0.25), (0.45, 0.1), (0.7, 0.3), (1.0, 0.9)),
        ((0.1, 0.15, 0.35, 0.8), (0.4, 0.9, 0.9, 0.5), (0.7, 0.95, 0.5, 0.1), (1.0, 0.8, 0.1, 0.1)),
    ),
    "flame": TransferFunction(
        ((0.08, 0.0), (0.3, 0.12), (0.6, 0.3), (1.0, 0.8)),
        ((0.1, 0.5, 0.05, 0.0), (0.35, 0.95, 0.35, 0.05), (0.7, 1.0, 0.8, 0.2), (1.0, 1.0, 1.0, 0.85)),
    ),
}


def main(output: str, folder: str, *names: str) -> None:
    """Measure series, and write what was measured."""
    measured = {name: series(name, Path(folder) / name) for name in names or SERIES}
    facts = {"machine": machine.describe(torch.device("cpu")), "series": measured}
    Path(output).write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")


def series(name: str, folder: Path) -> dict:
    """Follow one series, and return the means of its steps, and rows of those that are compared."""
    steps, tf = made(name, SAMPLES, STEPS), TFS[name]
    alone = {step: independent(folder, steps[step], tf, step) for step in compared()}
    key = read_model(folder / "finer-0.safetensors")
    model, follower, costs, rows = key, Follower(key, LOOK, tf), [], {}
    with machine.Load() as load:
        for step in range(1, STEPS):
            start, busy = perf_counter(), process_time()
            model = follower.step(model, *steps[step - 1 : step + 1], f"{name} {step}", step)
            costs.append((perf_counter() - start, process_time() - busy))
            file = write_step(folder / f"step-{step}.safetensors", key, model, {})
            model = at_step(key, file)
            if step in alone:
                row = {"psnr": quality(model, steps[step], tf), "bytes": file.stat().st_size, **alone[step]}
                rows[step] = row
                print(name, step, row, flush=True)
    seconds, processor = (fmean(each) for each in zip(*costs, strict=True))
    mean = {"seconds": seconds, "processor_seconds": processor, "surfels": len(key)}
    means = {part: fmean(row[part] for row in rows.values()) for part in ("psnr", "first_psnr", "finer_psnr")}
    return {**mean, "load": str(load), "key": alone[0], "steps": rows, "mean": means}


def compared() -> list[int]:
    """Return the key step, each tenth one and the last."""
    return sorted({*range(0, STEPS, EVERY), STEPS - 1})


def independent(folder: Path, grid: Grid, tf: TransferFunction, step: int) -> dict:
    """Fit models of one step alone, unless they are there, and return what they cost and show."""
    facts = folder / f"alone-{step}.json"
    if facts.exists():
        return read_json(facts)
    row, start, busy = {}, perf_counter(), process_time()
    fits = fit_now(Caster(grid, LOOK), LOOK, tf, lens_of(grid, tf), f"step {step} alone")
    for kind, model in zip(("first", "finer"), fits, strict=True):
        row |= {f"{kind}_seconds": perf_counter() - start, f"{kind}_processor_seconds": process_time() - busy}
        file = write_model(folder / f"{kind}-{step}.safetensors", model)
        packed = write_compact(folder / f"{kind}-{step}.texgs", model)
        row |= {f"{kind}_bytes": file.stat().st_size, f"{kind}_compact_bytes": packed.stat().st_size}
        row[f"{kind}_psnr"] = quality(model, grid, tf)
    write_json(facts, row)
    return row


def lens_of(grid: Grid, tf: TransferFunction) -> Lens:
    """Return the lens of views of a step, also of its test views."""
    return frame_of(grid, [tf]).lens(width=SIZE, height=SIZE)


@torch.no_grad()
def quality(model: Surfels, grid: Grid, tf: TransferFunction) -> float:
    """Return the mean PSNR on test views."""
    caster, values = Caster(grid, LOOK), []
    for camera in spiral(VIEWS, lens_of(grid, tf)):
        seen = caster.cast(tf, camera, HEADLIGHT).rgba
        values.append(psnr(model.render(camera).color, seen[..., :3] + 1 - seen[..., 3:]))
    return fmean(values)


if __name__ == "__main__":
    call(main, "benchmarks.series texgs.fitting.series")
