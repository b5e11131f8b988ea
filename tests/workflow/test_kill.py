"""A workflow that is killed in the middle of a job goes on where it was."""

import json
import os
import signal
import time

import pytest

from tests.workflow.project import Project
from texgs.workflow.result import run_alone

pytestmark = pytest.mark.workflow

MANY = "~dataset.basic_tfs.TF02 views.train.frequency=1 views.width=400 views.height=400 views.step=0.03"


def test_killed_in_the_middle_of_the_views(tmp_path):
    project = Project(tmp_path)
    views = project.work / "results" / "turbulence" / "TF01" / "views"
    work = views.with_name(".views.work")
    process = project.start(overrides=MANY)
    deadline = time.monotonic() + 300
    while len(images(work)) < 3 and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    assert process.poll() is None, process.communicate()
    os.killpg(process.pid, signal.SIGKILL)
    process.communicate()
    kept = images(work)
    assert 3 <= len(kept) < 12
    time.sleep(1)
    assert images(work) == kept, "the job outlived the workflow"
    assert not (views / "metrics.json").exists()
    assert "locked" in project.snakemake(overrides=MANY).stderr
    done = project.snakemake("--unlock", overrides=MANY)
    assert done.returncode == 0, done.stderr
    done = project.snakemake(overrides=MANY)
    assert done.returncode == 0, done.stdout + done.stderr
    finished = images(views)
    assert len(finished) == 12
    assert kept.items() <= finished.items()
    numbers = json.loads((views / "metrics.json").read_text())["numbers"]
    assert len(numbers["frames_ms"]) == 12 + 3 + 2 - 2, "one time per view, without the first of each run"


def images(views):
    """When each training view was written."""
    return {path.name: path.stat().st_mtime_ns for path in views.glob("train/r_*.png")}


def test_a_second_run_in_the_same_results_is_refused(tmp_path):
    project = Project(tmp_path)
    lock = run_alone(str(project.work / "results"))
    second = project.snakemake("--nolock")
    lock.release()
    assert second.returncode == 2
    assert "results: another run works there; wait for it to end" in second.stderr
    assert not list(project.work.rglob("*.work"))
