"""Run one job in a folder of its own, tracked, with its numbers in metrics.json."""

from __future__ import annotations

import time

from texgs.core.errors import ArgumentError
from texgs.core.io import write_json
from texgs.core.keys import ValueMismatch, typed
from texgs.core.progress import curve_logger
from texgs.report.results import plain
from texgs.workflow import result, tracked
from texgs.workflow.job import Job
from texgs.workflow.missing import require_same
from texgs.workflow.provenance import record
from texgs.workflow.runs import run


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
    made_from = {name: path.as_posix() for name, path in inputs if path.name in result.recorded(path.parent)}
    work = result.claim(job.output, identity, is_fresh=is_fresh)
    with run(
        tracking.uri,
        experiment=tracking.experiment,
        name=tracked.name(job),
        tags=tracked.tags(job, identity, tracking.parent),
        params={**job.swept, **job.settings},
    ) as recorded:
        start = time.perf_counter()
        with curve_logger(recorded.log if recorded.id else None):
            outcome = job.stage.work(settings, dict(job.inputs), work)
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
