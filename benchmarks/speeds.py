"""Speeds of the stages for `texgs doctor --experiment`, from what runs on this machine have taken.

`python -m benchmarks.speeds "WORDS OF A RUN" ...` scales `texgs/workflow/speeds.csv` to the jobs of these
runs that are done. Words are such as "dataset=engine fit=quick results=/tmp/run/results". Each stage gets one
factor, so that pixels and iterations keep the weights that longer runs have given them; stages that no run
has get the median of the others.
"""

import csv
import shlex
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import astuple, fields, replace
from importlib.resources import files
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

from benchmarks.command import call
from texgs.core.cache import Checksums
from texgs.core.io import read_json
from texgs.core.names import METRICS
from texgs.workflow.forecast import Speed, megapixels, speeds
from texgs.workflow.graph import graph_of
from texgs.workflow.sweep import as_sweep

FILE = Path(str(files("texgs.workflow").joinpath("speeds.csv")))
DIGITS = 2


class Sample(NamedTuple):
    """What one job had to do, and the seconds that it took."""

    settings: Mapping[str, Any]
    megapixels: float  # of a view
    seconds: float


def main(first: str, *others: str) -> None:
    """Write the file and print how far off it was."""
    measured = samples([first, *others])
    before = speeds()
    factors = {stage: factor(before[stage], some) for stage, some in measured.items()}
    typical = median(factors.values())
    table = {stage: scaled(speed, factors.get(stage, typical)) for stage, speed in before.items()}
    note = [line for line in FILE.read_text(encoding="utf-8").splitlines() if line.startswith("#")]
    with FILE.open("w", encoding="utf-8", newline="") as file:
        file.writelines(f"{line}\n" for line in note)
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(["stage", *(field.name for field in fields(Speed))])
        for stage, speed in table.items():
            *seconds, key = astuple(speed)
            writer.writerow([stage, *(f"{value:.{DIGITS}g}" for value in seconds), key])
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
                view, seconds = megapixels(planned.configs[folder]), read_json(metrics)["seconds"]
                by_stage[job.stage.name].append(Sample(job.settings, view, seconds))
    return by_stage


def factor(speed: Speed, some: Sequence[Sample]) -> float:
    """Seconds that samples took, all together, against those that a speed tells."""
    told = sum(speed.seconds(each.settings, each.megapixels) for each in some)
    return sum(each.seconds for each in some) / told


def scaled(speed: Speed, by: float) -> Speed:
    """A speed that takes as many times as long."""
    names = ("constant", "per_megapixel", "per_iteration")
    return replace(speed, **{name: by * getattr(speed, name) for name in names})


if __name__ == "__main__":
    call(main)
