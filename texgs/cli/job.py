"""Run one job: a stage with its settings, in a folder of its own, tracked, its numbers in metrics.json."""

from __future__ import annotations

import importlib
import shutil
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from filelock import FileLock, Timeout

from texgs import track
from texgs.cli.provenance import git_revision, record, user
from texgs.cli.stages.outcome import Outcome
from texgs.config.stage import Stage, settings_digest
from texgs.core.errors import ArgumentError
from texgs.core.io import read_json, write_json

STAMP = ".job.json"
FILES = ".files.json"  # names of what the job wrote
METRICS = "metrics.json"  # its presence tells the workflow that a job is done
BY_HAND = "metrics.by_hand.json"  # the same of a job that the workflow does not know of


@dataclass(frozen=True)
class Job:
    """A stage with everything it needs."""

    stage: Stage
    settings: dict[str, Any]
    inputs: Mapping[str, Path]
    output: Path

    def identity(self) -> dict[str, Any]:
        """What the job's result depends on: settings, code and input files."""
        files = {}
        for name, path in self.inputs.items():
            state = path.stat()
            files[name] = [state.st_size, state.st_mtime_ns]
        return {"settings": settings_digest(self.settings), "code": self.stage.code, "inputs": files}

    def is_done(self) -> bool:
        """Whether the folder holds the finished result of exactly this job."""
        stamp = self.output / STAMP
        is_finished = any((self.output / name).exists() for name in (METRICS, BY_HAND))
        return is_finished and stamp.exists() and read_json(stamp) == self.identity()


def discard(job: Job) -> None:
    """Remove the result of a job, finished or not, so that it starts from nothing."""
    if (job.output / STAMP).exists():
        shutil.rmtree(job.output)


def adopt(job: Job) -> None:
    """Let the workflow have a finished result that was made by hand."""
    if not (job.output / METRICS).exists():
        (job.output / BY_HAND).replace(job.output / METRICS)


def execute(job: Job, tracking: str | None, experiment: str, metrics_name: str = METRICS) -> dict[str, Any]:
    """Run a job and write its metrics; returns what they say.

    Files that an interrupted run of the same job left in the folder are kept, those of any other job removed.

    Args:
        job: what to run.
        tracking: URI of the tracking store, or None.
        experiment: of the tracking store.
        metrics_name: file of the metrics.

    Raises:
        TexgsError: for a mistake of the user.
    """
    with alone(job.output):
        return _execute(job, tracking, experiment, metrics_name)


@contextmanager
def alone(output: Path) -> Iterator[None]:
    """Keep other processes out of a job's folder.

    Raises:
        ArgumentError: if another job works there, or the folder above it cannot be written to.
    """
    lock = FileLock(output.parent / f".{output.name}.lock")
    try:
        output.parent.mkdir(parents=True, exist_ok=True)
        lock.acquire(blocking=False)
    except Timeout as error:
        raise ArgumentError(f"{output}: another job works there; wait for it to end") from error
    except OSError as error:
        raise ArgumentError(
            f"{output}: cannot write there ({error.strerror}); choose other results"
        ) from error
    try:
        yield
    finally:
        lock.release()


def _execute(job: Job, tracking: str | None, experiment: str, metrics_name: str) -> dict[str, Any]:
    for name, path in job.inputs.items():
        if not path.exists():
            raise ArgumentError(
                f"{name}: expected the file {path}, which is not there; run the stage that makes it"
            )
    identity = job.identity()
    claim(job.output, identity)
    tags = {
        "mlflow.user": user(),
        "snakemake.rule": job.stage.name,
        **{f"wildcards.{key}": job.settings[key] for key in ("dataset", "tf") if key in job.settings},
        "config.sha": identity["settings"],
        "code.sha": identity["code"],
        "git.sha": git_revision(),
        "output": job.output.as_posix(),
    }
    name = " ".join(str(job.settings[key]) for key in ("dataset", "tf", "stage") if key in job.settings)
    with track.run(tracking, experiment=experiment, name=name, tags=tags, params=job.settings) as run:
        start = time.perf_counter()
        outcome: Outcome = importlib.import_module(job.stage.module).work(
            job.settings, dict(job.inputs), job.output
        )
        seconds = time.perf_counter() - start
        metrics = {**record(job.settings, identity, seconds), "run": run.id, "numbers": outcome.numbers}
        write_json(
            job.output / FILES, sorted({METRICS, BY_HAND, *(path.name for path in job.output.iterdir())})
        )
        write_json(job.output / metrics_name, metrics)
        run.log(
            {"seconds": seconds, "peak_memory_mib": metrics["peak_memory_mib"], **scalars(outcome.numbers)}
        )
        for step, values in enumerate(series(outcome.numbers)):
            run.log(values, step)
        for path in (*outcome.pictures, job.output / metrics_name):
            run.artifact(path)
    return metrics


def claim(output: Path, identity: dict[str, Any]) -> None:
    """Make the folder this job's: empty, or with what the same job left there.

    Raises:
        ArgumentError: if the folder holds files that are not of texgs.
    """
    stamp = output / STAMP
    for name in (METRICS, BY_HAND):  # the job is not done before it is written again
        (output / name).unlink(missing_ok=True)
    if stamp.exists() and read_json(stamp) == identity:
        return
    if output.exists() and any(output.iterdir()):
        if not stamp.exists():
            raise ArgumentError(
                f"{output}: expected an empty folder or one of texgs, got other files; move them away"
            )
        if own := foreign_files(output):
            raise ArgumentError(
                f"{output}: the job is to be done again, but the folder also holds {', '.join(own[:3])}; "
                "move what is yours away"
            )
        shutil.rmtree(output)
    write_json(stamp, identity)


def foreign_files(output: Path) -> list[str]:
    """Files in the folder of a finished job that it did not write."""
    if not (output / FILES).exists():
        return []  # unfinished, or of no job at all
    written = {*read_json(output / FILES), STAMP, FILES}
    return sorted({path.name for path in output.iterdir()} - written)


def series(numbers: Mapping[str, Any]) -> Iterator[dict[str, float]]:
    """The entries that are lists of numbers of one kind, step by step."""
    lists = {key: value for key, value in numbers.items() if isinstance(value, list) and key.endswith("_ms")}
    for step in range(max(map(len, lists.values()), default=0)):
        yield {key: float(value[step]) for key, value in lists.items() if step < len(value)}


def scalars(numbers: Mapping[str, Any]) -> dict[str, float]:
    """The entries that are single numbers."""
    return {key: float(value) for key, value in numbers.items() if isinstance(value, int | float)}
