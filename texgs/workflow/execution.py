"""Run jobs: each in a folder of its own, tracked, with its numbers in metrics.json."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from os.path import relpath
from pathlib import Path
from typing import Any

from texgs.config.case import Case
from texgs.config.project import Words
from texgs.config.schema import Config
from texgs.core.cache import Checksums
from texgs.core.errors import ArgumentError, ConfigError
from texgs.core.io import write_json
from texgs.core.keys import ValueMismatch, typed
from texgs.core.progress import curve_logger
from texgs.edit.method import NO_METHOD
from texgs.report.results import Result, as_mapping
from texgs.volume.settings import cached_volume
from texgs.workflow import result, tracked
from texgs.workflow.job import Job, settings_file
from texgs.workflow.locate import source_file
from texgs.workflow.missing import require_same, weights_needed
from texgs.workflow.provenance import record
from texgs.workflow.runs import run
from texgs.workflow.stage import Outcome, Stage
from texgs.workflow.stage_table import jobs


@dataclass(frozen=True)
class Task:
    """A stage to run with a configuration. Its job is known when the files are there that it reads."""

    stage: Stage
    config: Config
    words: Words = ()  # that compose the configuration

    @property
    def output(self) -> Path:
        """The folder of the result."""
        return self.stage.output(self.config)

    def job(self, checksums: Checksums) -> Job:
        """Return the job, with what is known of files."""
        return Job.of(self.stage, self.config, checksums, self.words)


def execute(job: Job, tracking: tracked.Tracking, *, force: bool = False) -> bool:
    """Run a job, unless its result is there, and return whether there was something to do.

    An interrupted run of the same job goes on, unless it is forced to begin from nothing. The result before
    it stays until this one is complete.
    """
    with result.alone(job.output):
        result.recover(job.output)
        if not force and job.is_done():
            return False
        _execute(job, tracking, is_fresh=force)
    return True


def _execute(job: Job, tracking: tracked.Tracking, *, is_fresh: bool) -> None:
    """Run a job in its work folder, and put its result in place."""
    require_inputs(job)
    try:
        settings = typed(job.stage.schema, job.settings)
    except ValueMismatch as error:
        raise ArgumentError(f"settings of a {job.stage.name} job: {error}") from error
    identity = job.identity()
    inputs = job.inputs.items()
    made_from = {
        name: relpath(path, job.output)
        for name, path in inputs
        if path.name in result.file_checksums(path.parent)
    }
    work = result.claim(job.output, identity, is_fresh=is_fresh)
    with run(
        tracking.uri,
        experiment=tracking.experiment,
        name=tracked.name(job),
        tags=tracked.tags(job, identity, tracking.parent),
        params=tracked.params(job),
    ) as recorded:
        start = time.perf_counter()
        with curve_logger(recorded.log if recorded.id else None):
            outcome = job.stage.work(settings, dict(job.inputs), work)
        require_outcome(job.stage, outcome, work)
        seconds = time.perf_counter() - start
        metrics = {
            **record(job.settings, identity, made_from, seconds),
            "command": job.command,
            "run": recorded.id,
            "result": type(outcome.result).__name__,
            "numbers": as_mapping(outcome.result),
            "pictures": dict(job.stage.rule.shown if outcome.pictures is None else outcome.pictures),
        }
        write_json(work / result.METRICS, metrics)
        result.publish(job.output)
        tracked.log_result(recorded, job, metrics)


def require_inputs(job: Job) -> None:
    """Require the files that a job reads, as they were made, and the weights that its settings name."""
    for name, path in job.inputs.items():
        if not path.exists():
            raise ArgumentError(
                f"{name}: expected the file {path}, which is not there; run the stage that makes it"
            )
        result.require_intact(path)
    require_same(job.settings.get("weights", {}))


def require_outcome(stage: Stage, outcome: Any, folder: Path) -> None:
    """Require that a job has returned an Outcome and written the files that it names."""
    where = f"stage {stage.name}: work"
    if not isinstance(outcome, Outcome):
        raise ConfigError(f"{where}: expected an Outcome, got {type(outcome).__name__}")
    if not isinstance(outcome.result, Result):
        raise ConfigError(
            f"{where}: expected a kind of Result in its Outcome, got {type(outcome.result).__name__}"
        )
    for name in (*stage.rule.files, *(outcome.pictures or ())):
        if not (folder / name).exists():
            raise ConfigError(f"{where}: expected the file {name} in its folder, got none; write it there")


def fetch_volume(config: Config) -> None:
    """Download the volume's file, where it is not on this machine."""
    from texgs.volume.download import download

    volume, path = config.dataset.volume, source_file(config)
    if path is not None and volume.url and path == cached_volume(volume) and not path.exists():
        download(volume.url, str(volume.sha256), path)


def makers(case: Case) -> dict[Path, Task]:
    """Return the tasks that can make what a stage reads, by their folders."""
    config = case.config
    fits = [case.but(f"fit={recipe}") for recipe in config.fits] or [case]
    cases = [each.unedited for each in fits] + ([case] if config.edit.method != NO_METHOD else [])
    tasks = (Task(stage, each, one.words) for one in cases for stage, each in jobs(one.config))
    return {task.output: task for task in tasks}


def with_makers(task: Task, known: dict[Path, Task]) -> list[Task]:
    """Return a task behind the tasks that make what it reads, which are taken out of `known`.

    A volume that is not on this machine is downloaded, so that its job knows the path of the file.
    """
    if task.stage.name == "volume":
        fetch_volume(task.config)
    known.pop(task.output, None)
    folders = [path.parent for path in task.stage.inputs(task.config).values()]
    before = [each for folder in folders if folder in known for each in with_makers(known[folder], known)]
    return [*before, task]


def perform(
    task: Task,
    *,
    force: bool = False,
    tell: Callable[[str], None] = print,
    warn: Callable[[str], None] | None = None,
) -> None:
    """Run the job of a task, unless its result is there already.

    Args:
        task: whose input files are there.
        force: run it in any case.
        tell: gets a line about it.
        warn: gets a sentence where a result of other settings is replaced; default `tell`.
    """
    from texgs.models.weights import locate

    checksums, config = Checksums.load(), task.config
    job = task.job(checksums)
    if task.stage.place == "edit" and (force or not job.is_done()):
        for name in weights_needed(config.edit):
            locate(name)
        job = task.job(checksums)  # with what was downloaded
    if job.replaces_other():
        (warn or tell)(
            f"{job.output} holds results of other settings, which this replaces; another folder keeps both"
        )
    settings_file(job.settings, config.results)
    has_run = execute(job, tracked.Tracking(config.tracking.uri, config.tracking.experiment), force=force)
    checksums.save()
    tell(f"{job.output}: {'done' if has_run else 'up to date'}")


def ensure(
    stage: Stage,
    config: Config,
    known: dict[Path, Task] | None = None,
    *,
    tell: Callable[[str], None] = print,
    warn: Callable[[str], None] | None = None,
) -> None:
    """Run a stage behind the known tasks that make what it reads; arguments as for `perform`."""
    for task in with_makers(Task(stage, config), known if known is not None else {}):
        perform(task, tell=tell, warn=warn)
