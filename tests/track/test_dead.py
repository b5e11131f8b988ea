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
from texgs.workflow.runs import HOST, PROCESS, begin, is_alive, process_tags

pytestmark = pytest.mark.subprocess

ROOT = Path(__file__).parents[2]
# A job that says when its run is there, and then works for long.
JOB = """
import sys, time
from pathlib import Path
from texgs.workflow.runs import process_tags, run
tags = process_tags(Path(sys.argv[2]))
with run(sys.argv[1], experiment="texgs", name="job", tags=tags, params={}) as recorded:
    print(recorded.id, flush=True)
    time.sleep(600)
"""


def status_after_the_next(uri, client, killed):
    """Status of a run when another one has begun."""
    begin(uri, experiment="texgs", name="next", tags={}, params={})
    return client.get_run(killed).info.status


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


def test_the_next_run_closes_those_of_killed_processes(uri, client, killed):
    assert client.get_run(killed[0]).info.status == "RUNNING"
    following = begin(uri, experiment="texgs", name="next", tags={}, params={})
    assert client.get_run(killed[0]).info.status == "KILLED"
    assert status_after_the_next(uri, client, following.id) == "RUNNING", "this process lives"


@pytest.mark.parametrize(("named", "expected"), [(None, "FINISHED"), ("another", "KILLED")])
def test_a_run_whose_metrics_are_in_place_is_finished(uri, client, killed, named, expected):
    recorded, metrics = killed
    write_json(metrics, {"run": named or recorded})
    assert status_after_the_next(uri, client, recorded) == expected


def test_runs_of_other_machines_are_left_alone(uri, client, killed):
    client.set_tag(killed[0], HOST, "another-node")
    assert status_after_the_next(uri, client, killed[0]) == "RUNNING"


def test_one_with_a_key_is_closed_and_gone_on_with(uri, client):
    job = {"experiment": "texgs", "name": "job", "tags": {}, "params": {}, "key": "k"}
    first = begin(uri, **job)
    client.set_tag(first.id, PROCESS, "of a process that is gone")
    assert status_after_the_next(uri, client, first.id) == "KILLED"
    again = begin(uri, **job)
    assert again.id == first.id
    assert status_after_the_next(uri, client, first.id) == "RUNNING"


def test_another_process_with_the_same_number_is_another(tmp_path):
    own = process_tags(tmp_path)[PROCESS]
    assert is_alive(own)
    assert not is_alive(f"{os.getpid()} {psutil.Process().create_time() - 100}")
    assert not is_alive("")
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        tag = f"{child.pid} {psutil.Process(child.pid).create_time()}"
    time.sleep(0.1)
    assert not is_alive(tag)
