"""What a run would find on this machine, what it would do, and about how long that takes."""

import csv
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

from texgs.config.schema import Config
from texgs.workflow.cases import Cases
from texgs.workflow.job import Job
from texgs.workflow.locate import source_file
from texgs.workflow.sweep import as_sweep

PROBE = "probe"  # the row of speeds.csv with the seconds of `probe` on the same machine
START_SECONDS = 8  # of a run before its first job, on that machine
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

    constant: float
    per_megapixel: float  # of one view
    per_iteration: float  # and megapixel

    def seconds(self, megapixels: float, iterations: int) -> float:
        """Return those of one job."""
        return self.constant + megapixels * (self.per_megapixel + iterations * self.per_iteration)


def forecast(words: tuple[str, ...]) -> Forecast:
    """Return what a run with these words would do; nothing is written."""
    from texgs.core.cache import Checksums
    from texgs.workflow.graph import graph_of

    cases, planned = graph_of(as_sweep(words), Checksums.load())
    lack_files = {folder for folders in planned.missing.values() for folder in folders}
    table, to_do, seconds, done = speeds(), Counter[str](), 0.0, 0
    for folder, job in planned.run.items():
        if folder in lack_files:
            continue  # told where the selection is shown
        if job.is_done() and not planned.is_replaced(folder):
            done += 1
            continue
        to_do[job.stage.name] += 1
        speed = table.get(job.stage.name, Speed(0, 0, 0))  # nobody has measured stages of one's own
        seconds += STEP_SECONDS + speed.seconds(*work_of(job, planned.configs[folder]))
    return Forecast(cases, [*planned.missing], to_do, done, seconds + (START_SECONDS if to_do else 0))


def work_of(job: Job, config: Config) -> tuple[float, int]:
    """Return megapixels of a view of a job, and its iterations."""
    pixels = config.views.width * config.views.height / config.fit.reduce**2
    return pixels / 1e6, iterations(job.settings)


def iterations(settings: Any) -> int:
    """Return all iterations and steps that the settings of a job name."""
    if isinstance(settings, Mapping):
        own = [value for key, value in settings.items() if key == "iterations" or key.endswith("steps")]
        return sum(each for each in own if isinstance(each, int)) + sum(map(iterations, settings.values()))
    return sum(map(iterations, settings)) if isinstance(settings, list) else 0


def speeds() -> dict[str, Speed]:
    """Return the measured speeds by stage, and that of the probe."""
    text = files("texgs.workflow").joinpath("speeds.csv").read_text(encoding="utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return {row.pop("stage"): Speed(**{k: float(v) for k, v in row.items()}) for row in csv.DictReader(lines)}


def show(words: tuple[str, ...]) -> int:
    """Print a forecast, a line for each thing; return 1 if the run would not start."""
    from texgs.raster.probe import probe

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
        slower = probe() / speeds()[PROBE].constant
        print(
            f"time     about {duration(expected.seconds * slower)}: an estimate, from speeds measured on "
            f"other scenes; just now this machine rasterizes {1 / slower:.1f} times as fast as theirs"
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
