"""Runs of killed processes are closed by the next process, and no others."""

import os
import subprocess
import sys

import psutil
import pytest

from texgs.core.io import write_json
from texgs.workflow.runs import HOST, METRICS, PROCESS, begin, is_alive, process_tags

JOB: dict = {"experiment": "texgs", "name": "job", "tags": {}, "params": {}}


@pytest.fixture(scope="module")
def gone():
    """The tag of a process that has ended."""
    with subprocess.Popen([sys.executable, "-c", ""]) as child:
        return f"{child.pid} {psutil.Process(child.pid).create_time()}"


@pytest.fixture
def killed(uri, client, tmp_path, gone):
    """The run of a process that was killed, and the place of its metrics."""
    metrics = tmp_path / "views" / "metrics.json"
    run = begin(uri, **JOB)
    for tag, value in {PROCESS: gone, METRICS: str(metrics)}.items():
        client.set_tag(run.id, tag, value)
    return run.id, metrics


def status_after_the_next(uri, client, id):
    """Status of a run when another one has begun."""
    begin(uri, **JOB)
    return client.get_run(id).info.status


def test_the_next_run_closes_those_of_killed_processes(uri, client, killed):
    assert client.get_run(killed[0]).info.status == "RUNNING"
    assert status_after_the_next(uri, client, killed[0]) == "KILLED"
    own = begin(uri, **JOB)
    assert status_after_the_next(uri, client, own.id) == "RUNNING", "this process lives"


@pytest.mark.parametrize(("named", "expected"), [(None, "FINISHED"), ("another", "KILLED")])
def test_a_run_whose_metrics_are_in_place_is_finished(uri, client, killed, named, expected):
    recorded, metrics = killed
    write_json(metrics, {"run": named or recorded})
    assert status_after_the_next(uri, client, recorded) == expected


def test_runs_of_other_machines_are_left_alone(uri, client, killed):
    client.set_tag(killed[0], HOST, "another-node")
    assert status_after_the_next(uri, client, killed[0]) == "RUNNING"


def test_one_with_a_key_is_closed_and_gone_on_with(uri, client, gone):
    first = begin(uri, **JOB, key="k")
    client.set_tag(first.id, PROCESS, gone)
    assert status_after_the_next(uri, client, first.id) == "KILLED"
    assert begin(uri, **JOB, key="k").id == first.id
    assert status_after_the_next(uri, client, first.id) == "RUNNING"


def test_another_process_with_the_same_number_is_another(gone):
    assert is_alive(process_tags()[PROCESS])
    for other in (f"{os.getpid()} {psutil.Process().create_time() - 100}", "", gone):
        assert not is_alive(other)
