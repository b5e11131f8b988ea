"""The file of a store: made once, in odd places, or of something else."""

import os
import sqlite3
from contextlib import closing

import pytest
from mlflow import MlflowClient

from tests.refusals import refused
from tests.track.eight import assert_eight_jobs_lose_nothing
from texgs.workflow.runs import TrackingError, begin, run

pytestmark = pytest.mark.subprocess

JOB = {"experiment": "texgs", "name": "fit", "tags": {}, "params": {}}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the jobs are forked")
def test_eight_jobs_on_a_store_that_does_not_exist_yet(tmp_path):
    folders = [tmp_path / f"new folder {trial}%" for trial in range(2)]
    folders[1].mkdir()
    (folders[1] / ".mlflow.db.new").write_text("half a store, of a process that was killed")
    assert_eight_jobs_lose_nothing(tmp_path, *(f"sqlite:///{folder}/mlflow.db" for folder in folders))
    for folder in folders:
        left = {path.name for path in folder.iterdir()}
        assert left == {"mlflow.db", "mlartifacts", ".mlflow.db.lock"}


def test_a_store_of_another_mlflow_is_refused(database, uri):
    with closing(sqlite3.connect(database)) as connection, connection:
        connection.execute("UPDATE alembic_version SET version_num = 'ffffffffffff'")
    refused(lambda: begin(uri, **JOB), r"found version ffffffffffff.*run 'mlflow db upgrade", TrackingError)


def test_other_files_are_refused_and_left_alone(tmp_path):
    other = tmp_path / "other.db"
    with closing(sqlite3.connect(other)) as connection, connection:
        connection.execute("CREATE TABLE cats (name)")
    text = tmp_path / "notes.txt"
    text.write_text("not a database, but rather long so that SQLite reads its header" * 20)
    before = other.read_bytes(), text.read_bytes()
    refused(lambda: begin(f"sqlite:///{other}", **JOB), r"other\.db: ", TrackingError)
    refused(lambda: begin(f"sqlite:///{text}", **JOB), r"notes\.txt: .*not a database", TrackingError)
    refused(lambda: begin(f"sqlite:///{text}/below/mlflow.db", **JOB), "Not a directory", TrackingError)
    assert (other.read_bytes(), text.read_bytes()) == before


def test_a_project_with_quotes_and_a_question_mark_in_its_path(tmp_path, monkeypatch):
    project = tmp_path / """both 'kinds' of "quotes", or?"""
    project.mkdir()
    monkeypatch.chdir(project)
    with run("sqlite:///results/mlflow.db", **JOB) as job:
        job.artifact(__file__)
    assert job.trouble is None
    client = MlflowClient(tracking_uri="sqlite:///results/mlflow.db")
    assert [each.path for each in client.list_artifacts(job.id)] == ["test_store.py"]
    assert [path.name for path in (*tmp_path.iterdir(), *project.iterdir())] == [project.name, "results"]
