"""Runs in MLflow: of a job, the workflow or a sweep; those of killed processes are ended by the next one."""

from __future__ import annotations

import json
import logging
import os
import platform
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError
from texgs.workflow.store import cause, connect, public, reason, translated

if TYPE_CHECKING:
    from mlflow import MlflowClient

PARENT = "mlflow.parentRunId"  # tag of a run inside of another one
KEY = "texgs.parent"  # tag by which a run is found again
HOST, PROCESS, METRICS = "texgs.host", "texgs.process", "texgs.metrics"  # tags of its process
LONGEST_NAME = 250

logger = logging.getLogger("texgs")


class Run:
    """A run, whose errors it never raises: results are files, and outlive their tracking."""

    def __init__(self, client: MlflowClient | None = None, id: str | None = None, store: str = "") -> None:
        self.id = id  # in the store; None where tracking is off
        self.trouble: str | None = None  # why the run is incomplete, where it is; final when it has ended
        self._client: Any = client
        self._store = store
        self._sent: list[Callable[[], object]] = []  # each waits for what was sent, raises what went wrong

    def log(self, metrics: Mapping[str, float], step: int | None = None) -> None:
        """Record values, at a step of the job's loop where it has one. MLflow sends them within seconds."""
        if self._client is not None:
            from mlflow.entities import Metric

            now, items = round(time.time() * 1000), metrics.items()
            self._send(metrics=[Metric(allowed_name(key), float(x), now, step or 0) for key, x in items])

    def tag(self, tags: Mapping[str, str]) -> None:
        """Record tags that were not known when the run began."""
        if self._client is not None:
            from mlflow.entities import RunTag

            self._send(tags=[RunTag(allowed_name(key), str(value)) for key, value in tags.items()])

    def artifact(self, path: str | Path, folder: str | None = None) -> None:
        """Record a copy of a file or folder, in a folder of the run where one is given."""
        if self._client is None or self.trouble is not None:
            return  # each file would wait for a store that is away
        if not Path(path).exists():
            raise ArgumentError(f"{path}: no such file to record in the tracking store")
        self._attempt(lambda: self._client.log_artifact(self.id, str(path), folder))

    def end(self, status: str, error: BaseException | None = None) -> None:
        """Wait for what MLflow still sends, and end the run: FINISHED, FAILED with the error, or KILLED."""
        if self._client is None:
            return
        if error is not None:
            self.tag({"error": f"{type(error).__name__}: {reason(error)}"})
        for call in (lambda: self._client.set_terminated(self.id, status), *self._sent):
            self._attempt(call)
        if self.trouble is not None:
            logger.warning(
                "tracking: run %s in %s is incomplete (%s); the results of the job are not affected",
                *(self.id, self._store, self.trouble),
            )

    def _send(self, **entries: Any) -> None:
        """Hand entries to MLflow, whose threads send them."""

        def send() -> None:
            if operations := self._client.log_batch(self.id, synchronous=False, **entries):
                self._sent.append(operations.wait)

        self._attempt(send)

    def _attempt(self, call: Callable[[], object]) -> None:
        outer = sys.exception()
        try:
            call()
        except Exception as error:
            self.trouble = self.trouble or cause(error, outer)


def begin(
    uri: str | None,
    *,
    experiment: str,
    name: str,
    tags: Mapping[str, str],
    params: Mapping[str, object],
    key: str | None = None,
) -> Run:
    """Begin a run of an experiment, which `Run.end` ends; the first one ends those of killed processes.

    The store is `sqlite:///PATH`, with the files of runs in `mlartifacts` beside it, the http address of an
    MLflow server, or None to switch tracking off. The tag `PARENT` says which run it is inside of. Where
    there is a run with the same key, that goes on.
    """
    if uri is None:
        return Run()
    client, experiment_id = connect(uri, experiment)
    with translated(uri):
        if PARENT not in tags:
            end_killed(client)
        own = {allowed_name(x): str(value) for x, value in {**process_tags(), **tags}.items()}
        known = client.search_runs([experiment_id], f"tags.`{KEY}` = '{key}'", max_results=1) if key else []
        if known:
            id = str(known[0].info.run_id)
            client.update_run(id, status="RUNNING")
            for each, value in own.items():
                client.set_tag(id, each, value)
        else:
            from mlflow.entities import Param

            own |= {KEY: key} if key else {}
            id = str(client.create_run(experiment_id, tags=own, run_name=name).info.run_id)
            client.log_batch(id, params=[Param(each, text) for each, text in flatten(params).items()])
    return Run(client, id, public(uri))


@contextmanager
def run(uri: str | None, **job: Any) -> Iterator[Run]:
    """Record a job as one run; arguments as for `begin`.

    The run ends as FINISHED, as FAILED where the job raises, or as KILLED where it is interrupted.
    A store that is lost on the way never fails the job, and is named in one warning of the logger `texgs`.
    """
    recorded = begin(uri, **job)
    try:
        yield recorded
    except BaseException as error:
        is_error = isinstance(error, Exception)
        recorded.end("FAILED" if is_error else "KILLED", error if is_error else None)
        raise
    recorded.end("FINISHED")


def flatten(values: Mapping[str, object], prefix: str = "") -> dict[str, str]:
    """Return parameters of a nested mapping: keys joined by dots, lists and such as JSON."""
    flat: dict[str, str] = {}
    for key, value in values.items():
        if isinstance(value, Mapping) and value:
            flat |= flatten(value, f"{prefix}{key}.")
        else:
            is_plain = not (value is None or isinstance(value, bool | list | tuple | Mapping))
            flat[allowed_name(f"{prefix}{key}")] = str(value) if is_plain else json.dumps(value, default=str)
    return flat


def allowed_name(text: str) -> str:
    """Return a name MLflow accepts: others' characters become underscores, empty and dotted parts go."""
    allowed = re.sub(r"[^\w./: -]", "_", text)
    parts = [part for part in allowed.split("/") if part not in ("", ".", "..")]
    return "/".join(parts)[:LONGEST_NAME].rstrip("/") or "_"


def process_tags(metrics: Path | None = None) -> dict[str, str]:
    """Return tags that say which process a run is of, and where the metrics of its job will be."""
    import psutil

    own = {HOST: platform.node(), PROCESS: f"{os.getpid()} {psutil.Process().create_time()}"}
    return own if metrics is None else {**own, METRICS: str(metrics.absolute())}


def end_killed(client: MlflowClient) -> None:
    """End the runs of this machine whose process is gone: MLflow leaves them RUNNING for ever.

    A run whose metrics are in place is FINISHED: its process was killed after its work. Others are KILLED.
    """
    words = f"attributes.status = 'RUNNING' AND tags.`{HOST}` = '{platform.node()}'"
    experiments = [experiment.experiment_id for experiment in client.search_experiments()]
    for each in client.search_runs(experiments, words):
        id, tags = each.info.run_id, each.data.tags
        if is_alive(tags.get(PROCESS, "")) or client.get_run(id).info.status != "RUNNING":
            continue  # it may have ended since the search
        is_finished = False
        with suppress(OSError, ValueError, AttributeError):  # of metrics that are not there, or damaged
            is_finished = json.loads(Path(tags.get(METRICS, "")).read_text()).get("run") == id
        client.set_terminated(id, "FINISHED" if is_finished else "KILLED")


def is_alive(process: str) -> bool:
    """Return whether the process of a tag still runs, and is not another one with its number."""
    import psutil

    number, _, started = process.partition(" ")
    try:
        return str(psutil.Process(int(number)).create_time()) == started
    except (psutil.NoSuchProcess, ValueError):
        return False
