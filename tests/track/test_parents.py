"""Runs that hold others: begun by a run of the workflow, gone on with by the next one."""

import os
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from texgs.core.errors import ArgumentError
from texgs.workflow.tracking import PARENT, Parent, close_dead_runs, open_parents, run

ROOT = Path(__file__).parents[2]
RUNS = {
    "": Parent("experiment=demo", {"stage": "workflow"}, {"experiment": "demo"}),
    "views": Parent("sweep views", {"stage": "sweep"}, {"keys": "views.train.frequency"}),
}
KILLED = """
import os, signal, sys
from texgs.workflow.tracking import Parent, open_parents
open_parents(sys.argv[1], "texgs", "k", {"": Parent("a", {}, {})})
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_the_first_holds_the_others_and_jobs_are_inside_of_them(uri, client, tmp_path):
    opened = open_parents(uri, "texgs", "k", RUNS)
    with run(uri, experiment="texgs", name="job", tags={PARENT: opened["views"].id}, params={}) as job:
        pass
    (tmp_path / "report.html").write_text("report")
    opened[""].artifact(tmp_path / "report.html")
    for each in opened.values():
        each.end("FINISHED")
    whole, sweep = (client.get_run(opened[name].id) for name in RUNS)
    assert (whole.info.run_name, whole.data.params) == ("experiment=demo", {"experiment": "demo"})
    assert PARENT not in whole.data.tags
    assert sweep.data.tags[PARENT] == whole.info.run_id
    inside = client.search_runs([whole.info.experiment_id], f"tags.`{PARENT}` = '{sweep.info.run_id}'")
    assert [each.info.run_id for each in inside] == [job.id]
    assert [each.path for each in client.list_artifacts(whole.info.run_id)] == ["report.html"]
    assert {each.info.status for each in (whole, sweep)} == {"FINISHED"}


def test_the_same_key_goes_on_with_the_same_runs(uri, client):
    first = open_parents(uri, "texgs", "k", RUNS)
    for each in first.values():
        each.end("FAILED")
    again, other = open_parents(uri, "texgs", "k", RUNS), open_parents(uri, "texgs", "l", RUNS)
    assert {name: each.id for name, each in again.items()} == {name: each.id for name, each in first.items()}
    assert client.get_run(again[""].id).info.status == "RUNNING"
    assert not {each.id for each in other.values()} & {each.id for each in first.values()}


def test_those_of_a_killed_process_are_closed_and_gone_on_with(uri, client):
    done = subprocess.run([sys.executable, "-c", KILLED, uri], cwd=ROOT, check=False)
    assert done.returncode == -signal.SIGKILL
    close_dead_runs(uri, "texgs")
    (killed,) = client.search_runs([client.get_experiment_by_name("texgs").experiment_id])
    assert killed.info.status == "KILLED"
    again = open_parents(uri, "texgs", "k", {"": RUNS[""]})[""]
    assert again.id == killed.info.run_id
    close_dead_runs(uri, "texgs")
    stored = client.get_run(again.id)
    assert stored.info.status == "RUNNING", "this process lives"
    assert stored.data.tags["texgs.process"].startswith(f"{os.getpid()} ")


def test_without_tracking_nothing_is_recorded():
    opened = open_parents(None, "texgs", "k", RUNS)
    opened[""].end("FINISHED")
    opened[""].tag({"file": "x"})
    assert [each.id for each in opened.values()] == [None, None]


def test_a_mistake_is_named():
    with pytest.raises(ArgumentError, match="expected sqlite:///PATH or the http address"):
        open_parents("results", "texgs", "k", RUNS)
