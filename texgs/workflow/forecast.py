"""What a run would find on this machine, what it would do, and about how long that takes."""

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import Any

from texgs.config.schema import Config
from texgs.workflow.cases import Cases
from texgs.workflow.locate import source_file
from texgs.workflow.sweep import as_sweep

START_SECONDS = 8  # of a run before its first job
STEP_SECONDS = 0.8  # between two jobs of a run


@dataclass(frozen=True)
class Forecast:
    """A run before it is started."""

    cases: Cases
    missing: Sequence[str]  # what it would stop at, a sentence each
    to_do: Mapping[str, int]  # jobs by stage
    done: int  # jobs whose results are there
    seconds: float  # of what is to be done, on the machine of speeds.csv


@dataclass(frozen=True)
class Speed:
    """Seconds of the jobs of a stage, as `benchmarks/speeds.py` has measured them."""

    constant: float = 0.0
    per_megapixel: float = 0.0  # of one view
    per_iteration: float = 0.0  # and megapixel
    iterations: str = ""  # key of their number in the settings of a job; empty where there are none

    def seconds(self, settings: Mapping[str, Any], megapixels: float) -> float:
        """Return those of one job."""
        iterations = number(settings, self.iterations) if self.iterations else 0
        return self.constant + megapixels * (self.per_megapixel + iterations * self.per_iteration)


def number(settings: Any, key: str) -> int:
    """Return the number at a key of settings, such as phase.iterations; of those in a list the sum."""
    if isinstance(settings, list):
        return sum(number(each, key) for each in settings)
    name, _, rest = key.partition(".")
    return number(settings[name], rest) if rest else int(settings[name] or 0)


@cache
def speeds() -> dict[str, Speed]:
    """Return the measured speeds by stage."""
    text = files("texgs.workflow").joinpath("speeds.csv").read_text(encoding="utf-8")
    rows = csv.DictReader(line for line in text.splitlines() if not line.startswith("#"))
    return {
        row["stage"]: Speed(
            float(row["constant"]),
            float(row["per_megapixel"]),
            float(row["per_iteration"]),
            row["iterations"],
        )
        for row in rows
    }


def megapixels(config: Config) -> float:
    """Return those of a view, as fits see it."""
    return config.views.width * config.views.height / config.fit.reduce**2 / 1e6


def forecast(words: tuple[str, ...]) -> Forecast:
    """Return what a run with these words would do; nothing is written."""
    from texgs.core.cache import Checksums
    from texgs.workflow.graph import graph_of

    cases, planned = graph_of(as_sweep(words), Checksums.load())
    lack_files = {folder for folders in planned.missing.values() for folder in folders}
    to_do, seconds, done = Counter[str](), 0.0, 0
    for folder, job in planned.run.items():
        if folder in lack_files:
            continue  # reported with the missing things
        if job.is_done() and not planned.is_replaced(folder):
            done += 1
            continue
        to_do[job.stage.name] += 1
        speed = speeds().get(job.stage.name, Speed())  # nobody has measured stages of one's own
        seconds += STEP_SECONDS + speed.seconds(job.settings, megapixels(planned.configs[folder]))
    return Forecast(cases, [*planned.missing], to_do, done, seconds + (START_SECONDS if to_do else 0))


def show(words: tuple[str, ...]) -> int:
    """Print a forecast, a line for each thing; return 1 if the run would not start."""
    expected = forecast(words)
    for name, config in {each.dataset.name: each for each in expected.cases.configs[::-1]}.items():
        if not any(line.startswith(f"data set {name}:") for line in expected.missing):
            print(f"ok       data set {name:16} {source(config)}")
    for entry in expected.cases.left_out:
        print(f"left out {entry.what}: {entry.why}")
    for line in expected.missing:
        print(f"missing  {line}")
    kinds = ", ".join(f"{count} {stage}" for stage, count in expected.to_do.items())
    print(f"jobs     {sum(expected.to_do.values())} to do ({kinds or 'none'}), {expected.done} done")
    if expected.to_do:
        print(
            f"time     about {duration(expected.seconds)} on two cores of an AMD EPYC with AVX-512, one job "
            "after the other, from speeds measured on other scenes"
        )
    return 1 if expected.missing else 0


def duration(seconds: float) -> str:
    """Return a time in words."""
    if seconds < 2 * 3600:
        return f"{max(1, round(seconds / 60))} min"
    return f"{seconds / 3600:.0f} hours" if seconds < 48 * 3600 else f"{seconds / 86400:.0f} days"


def source(config: Config) -> str:
    """Return where the data of a data set come from."""
    volume = config.dataset.volume
    if config.dataset.views_folder is not None:
        return str(Path(config.data_folder, config.dataset.views_folder))
    if (path := source_file(config)) is None:
        return f"generated: {volume.generator}"
    return str(path) if path.exists() else f"to be downloaded from {volume.url}"
