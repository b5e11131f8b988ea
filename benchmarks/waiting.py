"""Milliseconds of a training step by how long idle threads spin before they sleep: alone, and two at once.

`python -m benchmarks.waiting OUTPUT.json` measures in processes of their own, in turn, since OpenMP reads the
environment once. Two at once have all threads each, twice as many as there are processors.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from statistics import median
from time import perf_counter

from benchmarks.command import call

SPINS = (0, 300, 1000, 3000, 300_000)  # the last one is what GCC's OpenMP does if nobody says anything
ROUNDS, SECONDS, WARM = 3, 4.0, 20
SIZE, SURFELS = 400, 15_000


def main(output: str) -> None:
    """Print and write medians over rounds, and each of them."""
    import torch

    from benchmarks import machine

    runs: dict[str, dict[int, list[float]]] = {kind: {} for kind in ("alone", "two at once")}
    for _ in range(ROUNDS):
        for spins in SPINS:
            for processes, times in enumerate(runs.values(), start=1):
                times.setdefault(spins, []).append(milliseconds(spins, processes))
    medians = {kind: {n: round(median(each), 2) for n, each in times.items()} for kind, times in runs.items()}
    print(*medians.items(), sep="\n")
    described = machine.describe(torch.device("cpu"))
    report = {"machine": described, "size": SIZE, "surfels": SURFELS, "medians": medians, "rounds": runs}
    Path(output).write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")


def milliseconds(spins: int, processes: int) -> float:
    """Of a step, mean over the processes, which run at once."""
    environment = {**os.environ, "OMP_WAIT_POLICY": "passive", "GOMP_SPINCOUNT": str(spins)}
    command = [sys.executable, "-c", "from benchmarks.waiting import train; train()"]
    started = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True)
        for _ in range(processes)
    ]
    return sum(float(each.communicate()[0]) for each in started) / processes


def train() -> None:
    """Take steps for some seconds and print what one took."""
    import torch

    from benchmarks.fit import training

    fit = training(SIZE, SURFELS, torch.device("cpu"))
    for _ in range(WARM):
        fit.step()
    start, steps = perf_counter(), 0
    while perf_counter() - start < SECONDS:
        fit.step()
        steps += 1
    print(1e3 * (perf_counter() - start) / steps)


if __name__ == "__main__":
    call(main)
