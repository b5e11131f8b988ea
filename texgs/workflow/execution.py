"""Run one job in a folder of its own, tracked, with its numbers in metrics.json; or with those before it."""

import time
from collections.abc import Callable
from os.path import relpath
from pathlib import Path
from typing import Any

from texgs.config.case import Case
from texgs.config.schema import Config
from texgs.core.checksum import Checksums
from texgs.core.errors import ArgumentError, ConfigError
from texgs.core.io import write_json
from texgs.core.keys import ValueMismatch, typed
from texgs.core.progress import curve_logger
from texgs.edit.method import NO_METHOD
from texgs.report.results import Result, plain
from texgs.volume.settings import cached_volume
from texgs.workflow import result, tracked
from texgs.workflow.job import Job
from texgs.workflow.locate import source_file
from texgs.workflow.missing import needed, require_same
from texgs.workflow.provenance import record
from texgs.workflow.runs import run
from texgs.workflow.stage import Outcome, Stage
from texgs.workflow.stage_table import jobs


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
    for name, path in job.inputs.items():
        if not path.exists():
            raise ArgumentError(
                f"{name}: expected the file {path}, which is not there; run the stage that makes it"
            )
        result.require_intact(path)
    require_same(job.settings.get("weights", {}))
    try:
        settings = typed(job.stage.schema, job.settings)
    except ValueMismatch as error:
        raise ArgumentError(f"settings of a {job.stage.name} job: {error}") from error
    identity = job.identity()
    inputs = job.inputs.items()
    made_from = {
        name: relpath(path, job.output) for name, path in inputs if path.name in result.recorded(path.parent)
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
            "run": recorded.id,
            "result": type(outcome.result).__name__,
            "numbers": plain(outcome.result),
            "pictures": dict(job.stage.rule.shown if outcome.pictures is None else outcome.pictures),
        }
        write_json(work / result.METRICS, metrics)
        result.publish(job.output)
        tracked.log_result(recorded, job, metrics)


def require_outcome(stage: Stage, outcome: Any, folder: Path) -> None:
    """Require of a job that it tells what it has done, and has written what it names."""
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


def makers(case: Case) -> dict[Path, tuple[Stage, Config]]:
    """Return the jobs that can make what a stage reads, by their folders."""
    config = case.config
    fits = [case.but(f"fit={recipe}") for recipe in config.fits] or [case]
    configs = [each.unedited.config for each in fits]
    configs += [config] if config.edit.method != NO_METHOD else []
    return {stage.output(each): (stage, each) for config in configs for stage, each in jobs(config)}


def ensure(
    stage: Stage,
    config: Config,
    known: dict[Path, tuple[Stage, Config]] | None = None,
    *,
    force: bool = False,
    tell: Callable[[str], None] = print,
    warn: Callable[[str], None] | None = None,
) -> None:
    """Run a stage, and before it the jobs whose files it reads, unless their results are there already.

    Args:
        stage: to run.
        config: of it.
        known: those jobs by their folders, of which those that were run are taken out.
        force: run the stage itself in any case.
        tell: gets a line for each job.
        warn: gets a sentence where a result of other settings is replaced; default `tell`.
    """
    from texgs.models.weights import locate

    if stage.name == "volume":
        fetch_volume(config)
    known = {} if known is None else known
    known.pop(stage.output(config), None)
    for path in stage.inputs(config).values():
        if path.parent in known:
            ensure(*known[path.parent], known, tell=tell, warn=warn)
    checksums = Checksums.load()
    job = Job.of(stage, config, checksums)
    if stage.place == "edit" and (force or not job.is_done()):
        for name in needed(config.edit):
            locate(name)
        job = Job.of(stage, config, checksums)  # with what was downloaded
    if job.replaces_other():
        (warn or tell)(
            f"{job.output} holds results of other settings, which this replaces; another folder keeps both"
        )
    has_run = execute(job, tracked.Tracking(config.tracking.uri, config.tracking.experiment), force=force)
    checksums.save()
    tell(f"{job.output}: {'done' if has_run else 'up to date'}")
