"""Stores of MLflow: one SQLite file, made once however many jobs open it, or a server."""

from __future__ import annotations

import logging
import os
import re
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from texgs.core.errors import ArgumentError, TexgsError

if TYPE_CHECKING:
    from mlflow import MlflowClient

# What MLflow is told where the user has not decided otherwise: by default it tries again for minutes.
SETTINGS = {
    "MLFLOW_ASYNC_LOGGING_BUFFERING_SECONDS": "5",
    "MLFLOW_ASYNC_LOGGING_THREADPOOL_SIZE": "4",
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR": "false",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "10",
    "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",
}
CHATTERING = ("alembic", "mlflow", "urllib3.connectionpool")
ARTIFACTS = "mlartifacts"  # folder beside the file
LONGEST_REASON = 240


class TrackingError(TexgsError, RuntimeError):
    """The tracking store cannot be used."""


def connect(uri: str, experiment: str) -> tuple[MlflowClient, str]:
    """Open a store, made where there is none; return a client and the experiment's identifier."""
    os.environ.update({key: value for key, value in SETTINGS.items() if key not in os.environ})
    import mlflow  # sets the levels of its loggers, so that it comes before they are changed

    for name in CHATTERING:
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if uri.startswith(("http://", "https://")):
        with translated(uri):
            client = mlflow.MlflowClient(tracking_uri=uri)
            return client, _experiment_id(client, experiment, None)
    from filelock import FileLock

    database = path_of(uri)
    with translated(uri):
        database.parent.mkdir(parents=True, exist_ok=True)
        # MLflow makes tables in each process that finds none; processes that do so at once break the file.
        with FileLock(database.with_name(f".{database.name}.lock")):
            _prepare(database)
            client = mlflow.MlflowClient(tracking_uri=_address(database))
            return client, _experiment_id(client, experiment, database.with_name(ARTIFACTS).as_uri())


def path_of(uri: str) -> Path:
    """Return the absolute path of the file that an address such as `sqlite:///results/mlflow.db` names."""
    path = uri.removeprefix("sqlite:///")
    if path in (uri, "", ":memory:") or "?" in path:
        raise ArgumentError(
            "tracking: expected sqlite:///PATH or the http address of an MLflow server, "
            f"got {public(uri)[:LONGEST_REASON]!r}"
        )
    return Path(path).expanduser().resolve()


def _address(database: Path) -> str:
    """Return the address of a file for MLflow, which takes what follows a "?" for options."""
    return f"sqlite:///{os.path.relpath(database) if '?' in str(database) else database}"


def _prepare(database: Path) -> None:
    """Make a store where there is none, beside its place: a killed process leaves no half of one."""
    import sqlalchemy
    from mlflow.store.tracking.sqlalchemy_store import SqlAlchemyStore

    if database.exists() and database.stat().st_size:
        engine = sqlalchemy.create_engine(_address(database))
        tables = sqlalchemy.inspect(engine).get_table_names()
        engine.dispose()
        if "alembic_version" not in tables:
            raise TrackingError(
                f"{database}: expected a store of MLflow, got another database; choose another file"
            )
        return
    fresh = database.with_name(f".{database.name}.new")
    for left in database.parent.glob(f"{fresh.name}*"):
        left.unlink()
    # Not by a client: that puts the working directory into its SQL, which breaks at quotes.
    SqlAlchemyStore(_address(fresh), database.with_name(ARTIFACTS).as_uri()).engine.dispose()
    fresh.replace(database)


def _experiment_id(client: MlflowClient, name: str, location: str | None) -> str:
    """Return the experiment of a name, made where there is none that keeps its files in this place."""
    from mlflow.exceptions import MlflowException

    experiment = client.get_experiment_by_name(name)
    if experiment is not None and experiment.lifecycle_stage == "deleted":
        raise TrackingError(
            f"experiment {name!r} was deleted from the tracking store; bring it back with "
            f"`mlflow experiments restore --experiment-id {experiment.experiment_id}`, or choose another name"
        )
    if experiment is not None:
        if location in (None, experiment.artifact_location):
            return str(experiment.experiment_id)
        # The store was moved: MLflow keeps absolute addresses, and would go on to write to the old place.
        before = f"{name} {experiment.experiment_id}, before it was moved"
        client.rename_experiment(experiment.experiment_id, before)
    try:
        return str(client.create_experiment(name, artifact_location=location))
    except MlflowException:
        experiment = client.get_experiment_by_name(name)
        if experiment is None:  # else another process was faster, on a server
            raise
        return str(experiment.experiment_id)


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
