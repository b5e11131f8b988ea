"""Runs of processes that were killed: MLflow leaves them RUNNING for ever, the next process closes them."""

from __future__ import annotations

import json
import os
import platform
from pathlib import Path
from typing import TYPE_CHECKING

import psutil

if TYPE_CHECKING:
    from mlflow import MlflowClient
    from mlflow.entities import Run

HOST, PROCESS, METRICS = "texgs.host", "texgs.process", "texgs.metrics"  # tags


def process_tags(metrics: Path | None = None) -> dict[str, str]:
    """Return tags that say which process a run is of, and where the metrics of its job will be."""
    own = {HOST: platform.node(), PROCESS: f"{os.getpid()} {psutil.Process().create_time()}"}
    return own if metrics is None else {**own, METRICS: str(metrics.absolute())}


def close_dead(client: MlflowClient) -> None:
    """End the runs of this machine whose process is gone.

    A run whose metrics are in place is FINISHED: its process was killed after its work. Others are KILLED.
    """
    words = f"attributes.status = 'RUNNING' AND tags.`{HOST}` = '{platform.node()}'"
    experiments = [experiment.experiment_id for experiment in client.search_experiments()]
    for run in client.search_runs(experiments, words):
        if is_alive(run.data.tags.get(PROCESS, "")):
            continue
        if client.get_run(run.info.run_id).info.status == "RUNNING":  # else it has ended since the search
            client.set_terminated(run.info.run_id, "FINISHED" if is_recorded(run) else "KILLED")


def is_alive(process: str) -> bool:
    """Return whether the process of a tag still runs, and is not another one with its number."""
    number, _, started = process.partition(" ")
    try:
        return str(psutil.Process(int(number)).create_time()) == started
    except (psutil.NoSuchProcess, ValueError):
        return False


def is_recorded(run: Run) -> bool:
    """Return whether the metrics of a run's job are in place and name this run."""
    try:
        metrics = json.loads(Path(run.data.tags.get(METRICS, "")).read_text())
    except (OSError, ValueError):
        return False
    return bool(metrics.get("run") == run.info.run_id)
