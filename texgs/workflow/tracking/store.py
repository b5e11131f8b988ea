"""Connections to a tracking store, made so that MLflow neither chatters nor waits for minutes."""

import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING

from texgs.core.errors import ArgumentError
from texgs.workflow.tracking import sqlite
from texgs.workflow.tracking.errors import TrackingError, public

if TYPE_CHECKING:
    from mlflow import MlflowClient

# What MLflow is told where the user has not decided otherwise. Its own defaults retry for minutes, which
# would stop a job whose server is gone; a run itself sends again what was left over.
DEFAULTS = {
    "MLFLOW_DISABLE_TELEMETRY": "true",
    "MLFLOW_ENABLE_ARTIFACTS_PROGRESS_BAR": "false",
    "MLFLOW_HTTP_REQUEST_MAX_RETRIES": "1",
    "MLFLOW_HTTP_REQUEST_TIMEOUT": "20",
    "MLFLOW_SUPPRESS_PRINTING_URL_TO_STDOUT": "true",
}
SECONDS_TO_CONNECT = 5
CHATTERING = ("alembic", "mlflow", "urllib3.connectionpool")


@contextmanager
def calm(**settings: str) -> Iterator[None]:
    """Let MLflow work without telemetry, long waits and messages of its own; put everything back after.

    Args:
        settings: environment variables of MLflow that replace the defaults; the user's own win over both.
    """
    ours = {key: value for key, value in (DEFAULTS | settings).items() if key not in os.environ}
    os.environ.update(ours)
    try:
        # Its import sets the levels of its loggers, so that it comes before they are changed.
        import mlflow  # noqa: F401

        loggers = [logging.getLogger(name) for name in CHATTERING]
        levels = [logger.level for logger in loggers]
        for logger in loggers:
            logger.setLevel(logging.CRITICAL)
        try:
            yield
        finally:
            for logger, level in zip(loggers, levels, strict=True):
                logger.setLevel(level)
    finally:
        for key in ours:
            os.environ.pop(key, None)


def connect(uri: str, experiment: str) -> tuple["MlflowClient", str]:
    """Open a store, and make the experiment where there is none of this name.

    Args:
        uri: `sqlite:///PATH` for a local file, made where there is none, or the address of a server.
        experiment: name of the experiment.

    Returns:
        A client and the experiment's identifier.

    Raises:
        ArgumentError: if it is an address of another kind.
        TrackingError: if a local store cannot be made or upgraded, or the experiment was deleted.
        Exception: whatever MLflow raises where the store cannot be reached.
    """
    from mlflow import MlflowClient

    location = None
    if uri.startswith("sqlite:"):
        database = sqlite.path_of(uri)
        location = sqlite.prepare(database).as_uri()
        uri = f"sqlite:///{database}"
    elif not uri.startswith(("http://", "https://")):
        raise ArgumentError(
            f"tracking: expected sqlite:///PATH or the http address of an MLflow server, got {public(uri)!r}"
        )
    client = MlflowClient(tracking_uri=uri)
    return client, _experiment_id(client, experiment, location)


def _experiment_id(client: "MlflowClient", name: str, location: str | None) -> str:
    from mlflow.exceptions import MlflowException

    experiment = client.get_experiment_by_name(name)
    if experiment is None:
        try:
            return str(client.create_experiment(name, artifact_location=location))
        except MlflowException:
            experiment = client.get_experiment_by_name(name)
            if experiment is None:  # else another process was faster
                raise
    if experiment.lifecycle_stage == "deleted":
        raise TrackingError(
            f"experiment {name!r} was deleted from the tracking store; bring it back with "
            f"`mlflow experiments restore --experiment-id {experiment.experiment_id}`, or choose another name"
        )
    return str(experiment.experiment_id)
