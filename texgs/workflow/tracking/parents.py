"""Runs that hold others: one for a run of the workflow, and one for each of its sweeps."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from texgs.workflow.tracking.dead import close_dead, process_tags
from texgs.workflow.tracking.errors import translated
from texgs.workflow.tracking.record import Run, create, recorded, texts
from texgs.workflow.tracking.store import SECONDS_TO_CONNECT, calm, connect

if TYPE_CHECKING:
    from mlflow import MlflowClient

PARENT = "mlflow.parentRunId"  # tag of a run inside of another one
KEY = "texgs.parent"  # tag by which a parent is found again


@dataclass(frozen=True)
class Parent:
    """What a run that holds others is recorded with."""

    name: str
    tags: Mapping[str, str]
    params: Mapping[str, object]


def open_parents(uri: str | None, experiment: str, key: str, runs: Mapping[str, Parent]) -> dict[str, Run]:
    """Begin runs, the first of which holds the others, or go on with those that have the same key.

    They are RUNNING until `Run.end`, or until another process finds that this one was killed.

    Args:
        uri: as for `run`.
        experiment: name of the experiment, made where there is none.
        key: what tells these runs from those of other commands.
        runs: by names of the caller.

    Returns:
        The runs by the same names.

    Raises:
        ArgumentError, TrackingError: as `run`.
    """
    if uri is None:
        return {name: Run() for name in runs}
    opened: dict[str, Run] = {}
    with calm(MLFLOW_HTTP_REQUEST_TIMEOUT=str(SECONDS_TO_CONNECT)), translated(uri):
        client, experiment_id = connect(uri, experiment)
        close_dead(client, experiment_id)
        for name, parent in runs.items():
            above = {PARENT: str(first.id)} if (first := next(iter(opened.values()), None)) else {}
            own = {**parent.tags, **process_tags(), **above, KEY: f"{key} {name}"}
            id = reopened(client, experiment_id, own)
            if id is None:
                id = create(client, experiment_id, parent.name, own, parent.params)
            opened[name] = recorded(client, id, uri)
    return opened


def reopened(client: "MlflowClient", experiment_id: str, tags: Mapping[str, str]) -> str | None:
    """The run of the same key, RUNNING again with these tags; None where there is none."""
    from mlflow.entities import RunTag

    runs = client.search_runs([experiment_id], f"tags.`{KEY}` = '{tags[KEY]}'", max_results=1)
    if not runs:
        return None
    id = str(runs[0].info.run_id)
    client.update_run(id, status="RUNNING")
    client.log_batch(id, tags=[RunTag(name, value) for name, value in texts(tags).items()])
    return id
