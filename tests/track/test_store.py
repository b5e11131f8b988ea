"""The file of a store: made once, upgraded, moved, in odd places, or of something else."""

import os
import shutil
import sqlite3
from contextlib import closing
from pathlib import Path

import pytest
from mlflow import MlflowClient
from mlflow.artifacts import download_artifacts

from tests.track.eight import assert_eight_jobs_lose_nothing
from texgs.workflow.runs import begin, run
from texgs.workflow.store import TrackingError

pytestmark = pytest.mark.subprocess

JOB = {"experiment": "texgs", "name": "fit", "tags": {}, "params": {}}


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the jobs are forked")
def test_eight_jobs_on_a_store_that_does_not_exist_yet(tmp_path):
    folders = [tmp_path / f"new folder {trial}%" for trial in range(3)]
    folders[2].mkdir()
    (folders[2] / ".mlflow.db.new").write_text("half a store, of a process that was killed")
    assert_eight_jobs_lose_nothing(tmp_path, *(f"sqlite:///{folder}/mlflow.db" for folder in folders))
    for folder in folders:
        left = {path.name for path in folder.iterdir()}
        assert left == {"mlflow.db", "mlartifacts", ".mlflow.db.lock"}


def test_a_store_of_another_mlflow_is_refused(database, uri):
    with closing(sqlite3.connect(database)) as connection, connection:
        connection.execute("UPDATE alembic_version SET version_num = 'ffffffffffff'")
    with pytest.raises(TrackingError, match=r"found version ffffffffffff.*run 'mlflow db upgrade"):
        begin(uri, **JOB)


def test_other_files_are_refused_and_left_alone(tmp_path):
    other = tmp_path / "other.db"
    with closing(sqlite3.connect(other)) as connection, connection:
        connection.execute("CREATE TABLE cats (name)")
    text = tmp_path / "notes.txt"
    text.write_text("not a database, but rather long so that SQLite reads its header" * 20)
    before = other.read_bytes(), text.read_bytes()
    with pytest.raises(TrackingError, match=r"other\.db: expected a store of MLflow"):
        begin(f"sqlite:///{other}", **JOB)
    with pytest.raises(TrackingError, match=r"notes\.txt: .* cannot be used .*file is not a database"):
        begin(f"sqlite:///{text}", **JOB)
    with pytest.raises(TrackingError, match=r"the tracking store cannot be used .*Not a directory"):
        begin(f"sqlite:///{text}/below/mlflow.db", **JOB)
    assert (other.read_bytes(), text.read_bytes()) == before


def test_a_moved_store_goes_on_beside_its_files(tmp_path, empty_store):
    """Runs from before the move stay, in an experiment of another name."""
    old, new = tmp_path / "results", tmp_path / "archive" / "results"
    old.mkdir()
    shutil.copy(empty_store, old / "mlflow.db")
    with run(f"sqlite:///{old}/mlflow.db", **JOB) as first:
        first.log({"psnr": 30})
        first.artifact(__file__)
    shutil.copytree(old, new)
    shutil.rmtree(old)
    uri = f"sqlite:///{new}/mlflow.db"
    for _ in range(2):
        with run(uri, **JOB) as second:
            second.artifact(__file__, "tables")
    assert not old.exists()
    client = MlflowClient(tracking_uri=uri)
    place = {"run_id": second.id, "tracking_uri": uri}
    copy = download_artifacts(artifact_path="tables/test_store.py", **place)
    assert Path(copy).read_bytes() == Path(__file__).read_bytes()
    stored = client.get_run(first.id)
    assert stored.data.metrics == {"psnr": 30}
    names = {client.get_experiment(each).name for each in (stored.info.experiment_id,)}
    assert names == {f"texgs {stored.info.experiment_id}, before it was moved"}
    assert len(client.search_runs([client.get_experiment_by_name("texgs").experiment_id])) == 2


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
