"""Run one job: a stage with its settings, in a folder of its own, tracked, its numbers in metrics.json."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import yaml

from texgs.config.schema import Config
from texgs.core.checksum import Checksums, digest
from texgs.core.errors import ArgumentError
from texgs.core.io import write_bytes, write_json
from texgs.core.keys import ValueMismatch, typed
from texgs.core.progress import curve_logger
from texgs.report.results import plain
from texgs.workflow import result, tracked
from texgs.workflow.missing import require_same, weights_of
from texgs.workflow.provenance import record
from texgs.workflow.runs import run
from texgs.workflow.stage import Outcome, Stage


@dataclass(frozen=True)
class Job:
    """A stage with everything it needs."""

    stage: Stage
    settings: dict[str, Any]
    inputs: Mapping[str, Path]
    output: Path
    checksums: Checksums = field(default_factory=Checksums, compare=False)  # what is known of files
    swept: Mapping[str, str] = field(default_factory=dict, compare=False)  # see workflow/sweep.py

    @classmethod
    def of(cls, stage: Stage, config: Config, checksums: Checksums) -> Job:
        """Return the job that a configuration describes; its settings name the weights that it works with."""
        from texgs.workflow.sweep import swept  # not at the top: jobs go without Hydra

        settings, weights = stage.settings(config), weights_of(stage, config, checksums)
        named = {} if weights is None else {"weights": weights}
        files = stage.inputs(config), stage.output(config)
        return cls(stage, {**settings, **named}, *files, checksums, swept(config))

    def identity(self) -> dict[str, Any]:
        """Return what the job's result depends on: settings, code and the contents of input files."""
        return {
            "stage": self.stage.name,
            "settings": settings_digest(self.settings),
            "code": self.stage.code(self.settings),
            "inputs": {name: result.fingerprint(path, self.checksums) for name, path in self.inputs.items()},
        }

    def is_done(self) -> bool:
        """Return whether the folder holds the whole result of exactly this job."""
        if not result.is_complete(self.output, self.checksums):
            return False
        return all(path.exists() for path in self.inputs.values()) and (
            result.stamped(self.output) == self.identity()
        )


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
            outcome: Outcome = job.stage.work(settings, dict(job.inputs), work)
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


def settings_file(settings: dict[str, Any], results: str) -> str:
    """Write a job's settings to `RESULTS/.conf/STAGE-DIGEST.yaml`, unless that is there; return its path."""
    text = _yaml(settings)
    path = Path(results) / ".conf" / f"{settings['stage']}-{digest(text)}.yaml"
    if not path.exists():
        write_bytes(path, text.encode())
    return path.as_posix()


def settings_digest(settings: dict[str, Any]) -> str:
    """Return the digest of a job's settings: the one in the name of its file."""
    return digest(_yaml(settings))


def _yaml(settings: dict[str, Any]) -> str:
    return yaml.dump(settings, Dumper=yaml.CSafeDumper, allow_unicode=True)
