"""Speeds of the stages for `texgs doctor --experiment`, from what runs on this machine have taken.

`python -m benchmarks.speeds "WORDS OF A RUN" ...` scales `texgs/workflow/speeds.csv` to the jobs of these
runs that are done. Words are such as "dataset=engine fit=quick results=/tmp/run/results". Each stage gets one
factor, so that pixels and iterations keep the weights that longer runs have given them. Stages that no run
has are scaled as the probe says that this machine is faster or slower than that of the file.
"""

import csv
import shlex
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import fields
from importlib.resources import files
from pathlib import Path
from statistics import median
from typing import NamedTuple

from benchmarks.command import call
from texgs.core.cache import Checksums
from texgs.core.io import read_json
from texgs.core.names import METRICS
from texgs.raster.probe import probe
from texgs.workflow.forecast import PROBE, Speed, speeds, work_of
from texgs.workflow.graph import graph_of
from texgs.workflow.sweep import as_sweep

FILE = Path(str(files("texgs.workflow").joinpath("speeds.csv")))
PROBES = 5  # times that the probe is asked; the median counts
DIGITS = 2


class Sample(NamedTuple):
    """What one job had to do, and the seconds that it took."""

    megapixels: float
    iterations: int
    seconds: float


def main(first: str, *others: str) -> None:
    """Write the file and print how far off it was."""
    measured = samples([first, *others])
    before, now = speeds(), median(probe() for _ in range(PROBES))
    factors = {stage: factor(before[stage], some) for stage, some in measured.items()}
    by_probe = now / before[PROBE].constant  # also of the probe itself
    table = {stage: scaled(speed, factors.get(stage, by_probe)) for stage, speed in before.items()}
    note = [line for line in FILE.read_text(encoding="utf-8").splitlines() if line.startswith("#")]
    with FILE.open("w", encoding="utf-8", newline="") as file:
        file.writelines(f"{line}\n" for line in note)
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["stage", *(field.name for field in fields(Speed))])
        for stage, speed in table.items():
            writer.writerow([stage, *(f"{value:.{DIGITS}g}" for value in vars(speed).values())])
    print(f"probe: {by_probe:.2f} times as long")
    for stage, by in factors.items():
        print(f"{stage}: {len(measured[stage])} jobs took {by:.2f} times as long as the file said")


def samples(runs: Sequence[str]) -> dict[str, list[Sample]]:
    """Jobs of runs that are done, by stage."""
    by_stage: dict[str, list[Sample]] = defaultdict(list)
    for words in runs:
        _, planned = graph_of(as_sweep(tuple(shlex.split(words))), Checksums.load())
        for folder, job in planned.run.items():
            metrics = job.output / METRICS
            if metrics.exists():
                work = work_of(job, planned.configs[folder])
                by_stage[job.stage.name].append(Sample(*work, read_json(metrics)["seconds"]))
    return by_stage


def factor(speed: Speed, some: Sequence[Sample]) -> float:
    """Seconds that samples took, all together, against those that a speed tells."""
    told = sum(speed.seconds(each.megapixels, each.iterations) for each in some)
    return sum(each.seconds for each in some) / told


def scaled(speed: Speed, by: float) -> Speed:
    """A speed that takes as many times as long."""
    return Speed(*(by * value for value in vars(speed).values()))


if __name__ == "__main__":
    call(main)
