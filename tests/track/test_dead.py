"""Runs of killed processes are closed by the next process, and no others."""

import os
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import psutil
import pytest

from texgs.core.io import write_json
from texgs.workflow.tracking import close_dead_runs, process_tags, run
from texgs.workflow.tracking.dead import HOST, PROCESS, is_alive

ROOT = Path(__file__).parents[2]
# A job that says when its run is there, and then works for long.
JOB = """
import sys, time
from pathlib import Path
from texgs.workflow.tracking import process_tags, run
tags = process_tags(Path(sys.argv[2]))
with run(sys.argv[1], experiment="texgs", name="job", tags=tags, params={}) as recorded:
    print(recorded.id, flush=True)
    time.sleep(600)
"""


def statuses(client):
    """Status of each run by its number."""
    experiments = [each.experiment_id for each in client.search_experiments()]
    return {each.info.run_id: each.info.status for each in client.search_runs(experiments)}


@pytest.fixture(scope="module")
def killed_once(tmp_path_factory, empty_store):
    """A store with the run of a process that was killed, the run, and the place of its metrics."""
    folder = tmp_path_factory.mktemp("killed")
    database, metrics = shutil.copy(empty_store, folder / "mlflow.db"), folder / "views" / "metrics.json"
    command = [sys.executable, "-c", JOB, f"sqlite:///{database}", str(metrics)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as child:
        recorded = child.stdout.readline().strip()
        child.send_signal(signal.SIGKILL)
    return database, recorded, metrics


@pytest.fixture
def database(tmp_path, killed_once):
    """A store with that run for each test."""
    return shutil.copy(killed_once[0], tmp_path / "mlflow.db")


@pytest.fixture
def killed(killed_once):
    """The run of a process that was killed, and the place of its metrics."""
    _, recorded, metrics = killed_once
    yield recorded, metrics
    metrics.unlink(missing_ok=True)


def test_the_next_run_closes_those_of_killed_processes(uri, client, killed, tmp_path):
    assert statuses(client) == {killed[0]: "RUNNING"}
    tags = process_tags(tmp_path / "metrics.json")
    with run(uri, experiment="texgs", name="next", tags=tags, params={}) as following:
        assert statuses(client) == {killed[0]: "KILLED", following.id: "RUNNING"}
        close_dead_runs(uri, "texgs")
        assert statuses(client)[following.id] == "RUNNING", "this process lives"
    assert statuses(client) == {killed[0]: "KILLED", following.id: "FINISHED"}


def test_a_run_whose_metrics_are_in_place_is_finished(uri, client, killed):
    recorded, metrics = killed
    write_json(metrics, {"run": recorded})
    close_dead_runs(uri, "texgs")
    assert statuses(client) == {recorded: "FINISHED"}


def test_metrics_of_another_run_do_not_count(uri, client, killed):
    recorded, metrics = killed
    write_json(metrics, {"run": "another"})
    close_dead_runs(uri, "texgs")
    assert statuses(client) == {recorded: "KILLED"}


def test_runs_of_other_machines_are_left_alone(uri, client, killed):
    client.set_tag(killed[0], HOST, "another-node")
    close_dead_runs(uri, "texgs")
    assert statuses(client) == {killed[0]: "RUNNING"}


def test_another_process_with_the_same_number_is_another(tmp_path):
    own = process_tags(tmp_path)[PROCESS]
    assert is_alive(own)
    assert not is_alive(f"{os.getpid()} {psutil.Process().create_time() - 100}")
    assert not is_alive("")
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        tag = f"{child.pid} {psutil.Process(child.pid).create_time()}"
    time.sleep(0.1)
    assert not is_alive(tag)
