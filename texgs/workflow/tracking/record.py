"""Runs: what a job reports about itself while it works."""

import logging
import sys
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.errors import ArgumentError
from texgs.workflow.tracking.dead import close_dead
from texgs.workflow.tracking.errors import cause, public, reason, translated
from texgs.workflow.tracking.fields import LONGEST_TAG, allowed_name, cut, flatten
from texgs.workflow.tracking.store import SECONDS_TO_CONNECT, calm, connect

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import Metric, RunTag

SECONDS_BETWEEN_BATCHES = 10.0
MOST_METRICS_KEPT = 100_000  # about 50 MB, where the store is gone for the rest of a long job

logger = logging.getLogger("texgs")


class Run:
    """A run that is not recorded: tracking is off.

    Attributes:
        id: the run's identifier in the store; None here.
        lost: number of metrics and files that could not be recorded; final when the run has ended.
    """

    id: str | None = None
    lost: int = 0

    def log(self, metrics: Mapping[str, float], step: int | None = None) -> None:
        """Record values, at a step of the job's loop where it has one. They are sent some seconds later."""

    def artifact(self, path: str | Path, folder: str | None = None) -> None:
        """Record a copy of a file or folder, in a folder of the run where one is given.

        Raises:
            ArgumentError: if there is no such file.
        """

    def tag(self, tags: Mapping[str, str]) -> None:
        """Record tags that were not known when the run began."""

    def end(self, status: str, error: Exception | None = None) -> None:
        """End the run: FINISHED, FAILED with the error, or KILLED. `run` does this by itself."""


@contextmanager
def run(
    uri: str | None, *, experiment: str, name: str, tags: Mapping[str, str], params: Mapping[str, object]
) -> Iterator[Run]:
    """Record a job as one run of an experiment.

    The run ends as FINISHED, as FAILED where the job raises, or as KILLED where it is interrupted.
    A store that is lost on the way never fails the job: what could not be recorded is counted in `Run.lost`
    and named in one warning of the logger `texgs`.

    Args:
        uri: `sqlite:///PATH` for a local file, made where there is none, with the files of runs in
            `mlartifacts` beside it; the http address of an MLflow server; or None to switch tracking off.
        experiment: name of the experiment, made where there is none.
        name: name of the run.
        tags: tags of the run.
        params: parameters of the job; nested mappings become dotted names, lists JSON.

    Yields:
        The run.

    Raises:
        ArgumentError: if `uri` is of another kind.
        TrackingError: if the store cannot be used when the job starts.
    """
    if uri is None:
        yield Run()
        return
    recorded = _start(uri, experiment, name, tags, params)
    try:
        yield recorded
    except Exception as error:
        recorded.end("FAILED", error)
        raise
    except BaseException:
        recorded.end("KILLED")
        raise
    recorded.end("FINISHED")


def close_dead_runs(uri: str | None, experiment: str) -> None:
    """End the runs of processes of this machine that were killed; a local store is made where there is none.

    Args:
        uri: as for `run`.
        experiment: whose runs.

    Raises:
        ArgumentError, TrackingError: as `run`.
    """
    if uri is None:
        return
    with calm(MLFLOW_HTTP_REQUEST_TIMEOUT=str(SECONDS_TO_CONNECT)), translated(uri):
        close_dead(*connect(uri, experiment))


def _start(
    uri: str, experiment: str, title: str, tags: Mapping[str, str], params: Mapping[str, object]
) -> Run:
    with calm(MLFLOW_HTTP_REQUEST_TIMEOUT=str(SECONDS_TO_CONNECT)), translated(uri):
        client, experiment_id = connect(uri, experiment)
    with calm(), translated(uri):
        close_dead(client, experiment_id)
        return recorded(client, create(client, experiment_id, title, tags, params), uri)


def recorded(client: "MlflowClient", id: str, uri: str) -> Run:
    """A run that is in a store."""
    return _Recorded(client, id, public(uri))


def create(
    client: "MlflowClient",
    experiment_id: str,
    title: str,
    tags: Mapping[str, str],
    params: Mapping[str, object],
) -> str:
    """Make a run with all that is known of it at the start; its identifier."""
    from mlflow.entities import Param

    created = client.create_run(experiment_id, tags=texts(tags), run_name=title)
    entries = [Param(key, value) for key, value in flatten(params).items()]
    client.log_batch(created.info.run_id, params=entries)
    return str(created.info.run_id)


def texts(tags: Mapping[str, str]) -> dict[str, str]:
    """Tags as MLflow takes them."""
    return {allowed_name(key): cut(str(value), LONGEST_TAG) for key, value in tags.items()}


class _Recorded(Run):
    """A run in a store. Metrics are sent in batches, and whatever fails is sent again with the next one."""

    id: str

    def __init__(self, client: "MlflowClient", id: str, store: str) -> None:
        self.id = id
        self._client = client
        self._store = store
        self._metrics: list[Metric] = []
        self._tags: list[RunTag] = []
        self._files: list[tuple[Path, str | None]] = []
        self._due = time.monotonic() + SECONDS_BETWEEN_BATCHES
        self._trouble: str | None = None

    def log(self, metrics: Mapping[str, float], step: int | None = None) -> None:
        from mlflow.entities import Metric

        now = round(time.time() * 1000)
        self._metrics += [
            Metric(allowed_name(key), float(value), now, step or 0) for key, value in metrics.items()
        ]
        excess = len(self._metrics) - MOST_METRICS_KEPT
        if excess > 0:
            del self._metrics[:excess]
            self.lost += excess
        if time.monotonic() >= self._due:
            self._attempt(self._deliver)

    def artifact(self, path: str | Path, folder: str | None = None) -> None:
        path = Path(path)
        if not path.exists():
            raise ArgumentError(f"{path}: no such file to record in the tracking store")
        self._files.append((path, folder))
        if self._trouble is None or time.monotonic() >= self._due:
            self._attempt(self._deliver)

    def tag(self, tags: Mapping[str, str]) -> None:
        from mlflow.entities import RunTag

        self._tags += [RunTag(key, value) for key, value in texts(tags).items()]

    def end(self, status: str, error: Exception | None = None) -> None:
        """Send what is left and close the run; where that fails, say so in one warning."""
        self._attempt(self._deliver, lambda: self._close(status, error))
        self.lost += len(self._metrics) + len(self._files)
        if self._trouble is not None or self.lost:
            logger.warning(
                "tracking: run %s in %s is incomplete, %d metrics and files are missing (%s); "
                "the results of the job are not affected",
                *(self.id, self._store, self.lost),
                self._trouble or "the store was away for too long",
            )

    def _attempt(self, *calls: Callable[[], None]) -> None:
        """Make calls to the store; never raises, since results are files and a job outlives its tracking."""
        start, outer = time.monotonic(), sys.exception()
        self._trouble = None
        try:
            with calm():
                for call in calls:
                    call()
        except Exception as error:
            self._trouble = cause(error, outer)
        # A slow or missing store may cost a tenth of the time, not more.
        self._due = time.monotonic() + max(SECONDS_BETWEEN_BATCHES, 10 * (time.monotonic() - start))

    def _deliver(self) -> None:
        """Send what waits. A batch that arrived only in part may be sent again: MLflow keeps one of each."""
        self._client.log_batch(self.id, metrics=self._metrics, tags=self._tags)
        self._metrics.clear()
        self._tags.clear()
        while self._files:
            path, folder = self._files[0]
            self._client.log_artifact(self.id, str(path), folder)
            del self._files[0]

    def _close(self, status: str, error: Exception | None) -> None:
        if error is not None:
            self._client.set_tag(self.id, "error", f"{type(error).__name__}: {reason(error)}")
        self._client.set_terminated(self.id, status)
