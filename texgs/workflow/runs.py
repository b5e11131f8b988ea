"""Runs in MLflow, of jobs, workflows and sweeps. This file alone uses MLflow, by its fluent interface.

Beyond that interface it uses `SqlAlchemyStore`: MLflow makes the tables of a file in each process that finds
none, in many steps, so that two processes at once, or one that is killed, leave a file that nothing can open.
"""

from __future__ import annotations

import logging
import os
import re
import sqlite3
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any

from texgs.core.errors import ArgumentError, TexgsError

PARENT = "mlflow.parentRunId"  # tag of a run inside of another one
KEY = "texgs.parent"  # tag by which a run is found again
OUTPUT = "output"  # tag with the absolute path of the results of a run
# What MLflow is told where the user has not decided otherwise: by default it tries again for minutes.
SETTINGS = {
    "MLFLOW_ASYNC_LOGGING_BUFFERING_SECONDS": "5",
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR": "false",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "10",
    "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",
}
CHATTERING = ("alembic", "mlflow", "urllib3.connectionpool")
ARTIFACTS = "mlartifacts"  # folder beside the file of a store
LONGEST_NAME, LONGEST_REASON = 250, 240  # characters

logger = logging.getLogger("texgs")


class TrackingError(TexgsError, RuntimeError):
    """The tracking store cannot be used."""


class Run:
    """The active run of this thread, whose errors it never raises: results are files, and need no store."""

    def __init__(self, id: str | None = None, store: str = "") -> None:
        self.id = id  # in the store; None where tracking is off
        self.trouble: str | None = None  # why the run is incomplete; nothing more is sent then
        self._store = store
        self._sent: list[Any] = []  # operations of MLflow's threads, which tell what went wrong

    def log(self, metrics: Mapping[str, float], step: int | None = None) -> None:
        """Record values, at a step of the job's loop where it has one. MLflow sends them within seconds."""
        values = {allowed_name(name): float(value) for name, value in metrics.items()}
        self._send(lambda mlflow: mlflow.log_metrics(values, step, synchronous=False))

    def tag(self, tags: Mapping[str, str]) -> None:
        """Record tags that were not known when the run began."""
        self._send(lambda mlflow: mlflow.set_tags(tags, synchronous=False))

    def artifact(self, path: str | Path, folder: str | None = None) -> None:
        """Record a copy of a file or folder, in a folder of the run if one is given; also after its end."""
        self._send(lambda mlflow: mlflow.log_artifact(str(path), folder, run_id=self.id))

    def end(self, status: str, error: BaseException | None = None) -> None:
        """Wait for what MLflow still sends, and end the run: FINISHED, FAILED with the error, or KILLED."""
        if self.id is None:
            return
        import mlflow

        if error is not None:
            self.tag({"error": f"{type(error).__name__}: {reason(error)}"})
        for call in (lambda: mlflow.end_run(status), *(each.wait for each in self._sent)):
            self._attempt(call)
        if self.trouble is not None:
            logger.warning(
                "tracking: run %s in %s is incomplete (%s); the results of the job are not affected",
                *(self.id, self._store, self.trouble),
            )

    def _send(self, call: Callable[[Any], Any]) -> None:
        """Call MLflow, unless tracking is off or has failed: each call would wait for a lost store."""
        if self.id is None or self.trouble is not None:
            return
        import mlflow

        if operation := self._attempt(lambda: call(mlflow)):
            self._sent.append(operation)

    def _attempt(self, call: Callable[[], Any]) -> Any:
        outer = sys.exception()
        try:
            return call()
        except Exception as error:
            self.trouble = self.trouble or cause(error, outer)


def begin(
    uri: str | None,
    *,
    experiment: str,
    name: str,
    tags: Mapping[str, str],
    params: Mapping[str, str],
    key: str | None = None,
) -> Run:
    """Begin a run of an experiment, which `Run.end` ends, and end those that a killed process has left.

    The store is `sqlite:///PATH`, with the files of runs in `mlartifacts` beside it, the http address of an
    MLflow server, or None to switch tracking off. The tag `PARENT` says which run it is inside of. Where
    there is a run with the same key, that goes on.
    """
    if uri is None:
        return Run()
    with translated(uri):
        mlflow, experiment_id = opened(uri, experiment)
        if OUTPUT in tags:
            end_killed(mlflow, experiment_id, tags[OUTPUT])
        own, known = {allowed_name(each): str(value) for each, value in tags.items()}, []
        if key is not None:
            own[KEY] = key
            words = f"tags.`{KEY}` = '{key}'"
            known = mlflow.search_runs([experiment_id], words, max_results=1, output_format="list")
        id = known[0].info.run_id if known else None
        run = mlflow.start_run(id, experiment_id, name, nested=True, tags=own)
        if id is None:
            mlflow.log_params({allowed_name(each): value for each, value in params.items()})
    return Run(run.info.run_id, public(uri))


def end_killed(mlflow: Any, experiment_id: str, output: str) -> None:
    """End the runs at and below a folder of results that are RUNNING: their processes were killed.

    The process that begins a run has locked its folder, so nobody else works there. Where a job of another
    node does, its run has its right status when it ends.
    """
    words = "attributes.status = 'RUNNING'"
    for each in mlflow.search_runs([experiment_id], words, output_format="list"):
        if Path(each.data.tags.get(OUTPUT, "")).is_relative_to(output):
            mlflow.MlflowClient().set_terminated(each.info.run_id, "KILLED")


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


def opened(uri: str, experiment: str) -> tuple[Any, str]:
    """Return MLflow with its store, made where there is none, and the identifier of an experiment there."""
    os.environ.update({key: value for key, value in SETTINGS.items() if key not in os.environ})
    import mlflow  # sets the levels of its loggers, so that it comes before they are changed

    for name in CHATTERING:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if uri.startswith(("http://", "https://")):
        mlflow.set_tracking_uri(uri)
        # Where another process makes it at once, this returns it, but does not make it the active one.
        return mlflow, mlflow.set_experiment(experiment).experiment_id
    from filelock import FileLock

    database = path_of(uri)
    database.parent.mkdir(parents=True, exist_ok=True)
    with FileLock(database.with_name(f".{database.name}.lock")):
        require_store(database)
        mlflow.set_tracking_uri(address(database))
        if mlflow.get_experiment_by_name(experiment) is None:
            mlflow.create_experiment(experiment, database.with_name(ARTIFACTS).as_uri())
        return mlflow, mlflow.set_experiment(experiment).experiment_id


def path_of(uri: str) -> Path:
    """Return the absolute path of the file that an address such as `sqlite:///results/mlflow.db` names."""
    path = uri.removeprefix("sqlite:///")
    if path in (uri, "", ":memory:") or "?" in path:
        raise ArgumentError(
            "tracking: expected sqlite:///PATH or the http address of an MLflow server, "
            f"got {public(uri)[:LONGEST_REASON]!r}"
        )
    return Path(path).expanduser().resolve()


def address(database: Path) -> str:
    """Return the address of a file for MLflow, which takes what follows a "?" for options."""
    return f"sqlite:///{os.path.relpath(database) if '?' in str(database) else database}"


def require_store(database: Path) -> None:
    """Require a file with the tables of MLflow; where there is none, make it beside its place and move it."""
    if database.exists() and database.stat().st_size:
        with closing(sqlite3.connect(database)) as connection:
            tables = {name for (name,) in connection.execute("SELECT name FROM sqlite_master")}
        if "alembic_version" not in tables:
            raise TrackingError(
                f"{database}: expected a store of MLflow, got another database; choose another file"
            )
        return
    from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore

    fresh = database.with_name(f".{database.name}.new")
    for left in database.parent.glob(f"{fresh.name}*"):
        left.unlink()
    SqlAlchemyStore(address(fresh), database.with_name(ARTIFACTS).as_uri()).engine.dispose()
    fresh.replace(database)


def allowed_name(text: str) -> str:
    """Return a name MLflow accepts: others' characters become underscores, empty and dotted parts go."""
    allowed = re.sub(r"[^\w./: -]", "_", text)
    parts = [part for part in allowed.split("/") if part not in ("", ".", "..")]
    return "/".join(parts)[:LONGEST_NAME].rstrip("/") or "_"


@contextmanager
def translated(uri: str) -> Iterator[None]:
    """Turn whatever MLflow raises into one TrackingError that names the store."""
    outer = sys.exception()
    try:
        yield
    except TexgsError:
        raise
    except Exception as error:  # the client passes on what any of the libraries below it raises
        raise TrackingError(
            f"{public(uri)}: the tracking store cannot be used ({cause(error, outer)}); "
            "check it, choose another one, or switch tracking off"
        ) from error


def cause(error: BaseException, outer: BaseException | None) -> str:
    """Return what lies at the bottom of an error of MLflow, such as "Connection refused".

    `outer` is what was being handled when MLflow was called: the job's own error is no cause.
    """
    while (deeper := error.__cause__ or error.__context__) and deeper is not outer:
        error = deeper
    return reason(error)


def reason(error: BaseException) -> str:
    """Return the first line of an error's message, shortened, or its type where there is none."""
    line = next(iter(str(error).splitlines()), "").strip()
    return public(line)[:LONGEST_REASON] or type(error).__name__


def public(text: str) -> str:
    """Return the text without the user name and password of an address in it."""
    return re.sub(r"//[^/@\s]*@", "//", text)
