"""Runs: what a job, the workflow or a sweep reports about itself."""

from __future__ import annotations

import json
import logging
import re
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from texgs.core.errors import ArgumentError
from texgs.workflow.tracking.dead import close_dead, process_tags
from texgs.workflow.tracking.store import cause, connect, public, reason, translated

if TYPE_CHECKING:
    from mlflow import MlflowClient

PARENT = "mlflow.parentRunId"  # tag of a run inside of another one
KEY = "texgs.parent"  # tag by which a run is found again
LONGEST_NAME = 250

logger = logging.getLogger("texgs")


class Run:
    """A run that is not recorded: tracking is off.

    Attributes:
        id: the run's identifier in the store; None here.
        trouble: why the run is incomplete, where it is; final when it has ended.
    """

    id: str | None = None
    trouble: str | None = None

    def log(self, metrics: Mapping[str, float], step: int | None = None) -> None:
        """Record values, at a step of the job's loop where it has one. MLflow sends them within seconds."""

    def tag(self, tags: Mapping[str, str]) -> None:
        """Record tags that were not known when the run began."""

    def artifact(self, path: str | Path, folder: str | None = None) -> None:
        """Record a copy of a file or folder, in a folder of the run where one is given."""

    def end(self, status: str, error: Exception | None = None) -> None:
        """End the run: FINISHED, FAILED with the error, or KILLED. `run` does this by itself."""


class _Recorded(Run):
    """A run in a store, whose errors it never raises: results are files, and outlive their tracking."""

    id: str

    def __init__(self, client: MlflowClient, id: str, store: str) -> None:
        self.id = id
        self._client, self._store = client, store
        self._sent: list[
            Callable[[], object]
        ] = []  # each waits for what was sent, and raises what went wrong

    def log(self, metrics: Mapping[str, float], step: int | None = None) -> None:
        from mlflow.entities import Metric

        now = round(time.time() * 1000)
        self._send(
            metrics=[Metric(allowed_name(key), float(x), now, step or 0) for key, x in metrics.items()]
        )

    def tag(self, tags: Mapping[str, str]) -> None:
        from mlflow.entities import RunTag

        self._send(tags=[RunTag(allowed_name(key), str(value)) for key, value in tags.items()])

    def artifact(self, path: str | Path, folder: str | None = None) -> None:
        if not Path(path).exists():
            raise ArgumentError(f"{path}: no such file to record in the tracking store")
        if self.trouble is None:  # else each file would wait for a store that is away
            self._attempt(lambda: self._client.log_artifact(self.id, str(path), folder))

    def end(self, status: str, error: Exception | None = None) -> None:
        """Wait for what MLflow still sends, and close the run; where that fails, say so in one warning."""
        if error is not None:
            self.tag({"error": f"{type(error).__name__}: {reason(error)}"})
        self._attempt(lambda: self._client.set_terminated(self.id, status))
        for wait in self._sent:
            self._attempt(wait)
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
    """Begin a run of an experiment, which `Run.end` ends; the first one closes those of killed processes.

    Args:
        uri: `sqlite:///PATH` for a local file, made where there is none, with the files of runs in
            `mlartifacts` beside it; the http address of an MLflow server; or None to switch tracking off.
        experiment: name of the experiment, made where there is none.
        name: name of the run.
        tags: tags of the run; the tag `PARENT` says which run it is inside of.
        params: parameters; nested mappings become dotted names, lists JSON.
        key: where there is a run with the same one, that goes on.
    """
    if uri is None:
        return Run()
    client, experiment_id = connect(uri, experiment)
    with translated(uri):
        if PARENT not in tags:
            close_dead(client)
        own = {allowed_name(x): str(value) for x, value in {**process_tags(), **tags}.items()}
        known = client.search_runs([experiment_id], f"tags.`{KEY}` = '{key}'", max_results=1) if key else []
        if known:
            id = str(known[0].info.run_id)
            client.update_run(id, status="RUNNING")
            for each, value in own.items():
                client.set_tag(id, each, value)
        else:
            id = _create(client, experiment_id, name, own | ({KEY: key} if key else {}), params)
    return _Recorded(client, id, public(uri))


@contextmanager
def run(
    uri: str | None, *, experiment: str, name: str, tags: Mapping[str, str], params: Mapping[str, object]
) -> Iterator[Run]:
    """Record a job as one run; arguments as for `begin`.

    The run ends as FINISHED, as FAILED where the job raises, or as KILLED where it is interrupted.
    A store that is lost on the way never fails the job, and is named in one warning of the logger `texgs`.
    """
    recorded = begin(uri, experiment=experiment, name=name, tags=tags, params=params)
    try:
        yield recorded
    except Exception as error:
        recorded.end("FAILED", error)
        raise
    except BaseException:
        recorded.end("KILLED")
        raise
    recorded.end("FINISHED")


def _create(
    client: MlflowClient,
    experiment_id: str,
    name: str,
    tags: Mapping[str, str],
    params: Mapping[str, object],
) -> str:
    """Make a run with all that is known of it at the start; its identifier."""
    from mlflow.entities import Param

    id = str(client.create_run(experiment_id, tags=dict(tags), run_name=name).info.run_id)
    client.log_batch(id, params=[Param(key, value) for key, value in flatten(params).items()])
    return id


def flatten(values: Mapping[str, object], prefix: str = "") -> dict[str, str]:
    """Return parameters of a nested mapping: keys joined by dots, lists and such as JSON.

    Example:
        >>> flatten({"fit": {"steps": 3, "rates": [0.1, 0.2]}})
        {'fit.steps': '3', 'fit.rates': '[0.1, 0.2]'}
    """
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
