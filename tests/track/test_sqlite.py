import os
import shutil
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from mlflow import MlflowClient
from mlflow.artifacts import download_artifacts

from tests.track.eight import assert_eight_jobs_lose_nothing
from texgs.core.errors import ArgumentError
from texgs.workflow.tracking import TrackingError, run, sqlite

JOB = {"experiment": "texgs", "name": "fit", "tags": {}, "params": {}}

DOWNGRADE = """
import sys, mlflow, sqlalchemy
from alembic import command
from mlflow.store.db.utils import _get_alembic_config
engine = sqlalchemy.create_engine(sys.argv[1])
config = _get_alembic_config(sys.argv[1])
with engine.begin() as connection:
    config.attributes["connection"] = connection
    command.downgrade(config, "-1")
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="the jobs are forked")
def test_eight_jobs_on_a_store_that_does_not_exist_yet(tmp_path):
    folders = [tmp_path / f"new folder {trial}%" for trial in range(3)]
    assert_eight_jobs_lose_nothing(tmp_path, *(f"sqlite:///{folder}/mlflow.db" for folder in folders))
    for folder in folders:
        left = {path.name for path in folder.iterdir()}
        assert left == {"mlflow.db", "mlartifacts", ".mlflow.db.lock"}


def test_current_store_takes_no_lock(database, monkeypatch):
    monkeypatch.setattr("filelock.FileLock", None)
    sqlite.prepare(database)


def test_older_store_is_upgraded_and_a_copy_kept(database, uri, client):
    with run(uri, **JOB) as record:
        record.log({"psnr": 30})
    newest = sqlite._revision(database)
    subprocess.run([sys.executable, "-c", DOWNGRADE, uri], check=True, capture_output=True)
    older = sqlite._revision(database)
    assert older != newest
    sqlite.prepare(database)
    assert sqlite._revision(database) == newest
    assert sqlite._revision(database.with_name(f"mlflow.db.{older}")) == older
    assert client.get_run(record.id).data.metrics == {"psnr": 30}


def test_store_of_a_newer_mlflow_is_refused(database):
    with closing(sqlite3.connect(database)) as connection, connection:
        connection.execute("UPDATE alembic_version SET version_num = 'ffffffffffff'")
    with pytest.raises(TrackingError, match=r"Can't locate revision.*ffffffffffff.*install the MLflow"):
        sqlite.prepare(database)


def test_other_files_are_refused_and_left_alone(tmp_path):
    other = tmp_path / "other.db"
    with closing(sqlite3.connect(other)) as connection, connection:
        connection.execute("CREATE TABLE cats (name)")
    text = tmp_path / "notes.txt"
    text.write_text("not a database, but rather long so that SQLite reads its header" * 20)
    before = other.read_bytes(), text.read_bytes()
    with pytest.raises(TrackingError, match=r"other\.db: expected a store of MLflow"):
        sqlite.prepare(other)
    with pytest.raises(TrackingError, match=r"notes\.txt: cannot be used .*file is not a database"):
        sqlite.prepare(text)
    with pytest.raises(TrackingError, match="cannot be used as a tracking store"):
        sqlite.prepare(text / "below" / "mlflow.db")
    assert (other.read_bytes(), text.read_bytes()) == before


def test_moved_results_keep_their_files(tmp_path, empty_store):
    file = tmp_path / "table.csv"
    file.write_text("1,2")
    old, new = tmp_path / "results", tmp_path / "archive" / "results"
    old.mkdir()
    shutil.copy(empty_store, old / "mlflow.db")
    with run(f"sqlite:///{old}/mlflow.db", **JOB) as first:
        first.artifact(file)
    shutil.copytree(old, new)
    shutil.rmtree(old)
    uri = f"sqlite:///{new}/mlflow.db"
    with run(uri, **JOB) as second:
        second.artifact(file, "tables")
    assert not old.exists()
    for record, path in ((first, "table.csv"), (second, "tables/table.csv")):
        assert MlflowClient(tracking_uri=uri).get_run(record.id).info.artifact_uri.startswith(new.as_uri())
        copy = download_artifacts(run_id=record.id, artifact_path=path, tracking_uri=uri)
        assert Path(copy).read_text() == "1,2"


def test_relative_address_is_resolved_at_once(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert sqlite.path_of("sqlite:///results/mlflow.db") == tmp_path / "results" / "mlflow.db"


@pytest.mark.parametrize("uri", ["sqlite://", "sqlite:///", "sqlite:///:memory:", "sqlite:///a.db?mode=ro"])
def test_addresses_without_a_file_are_refused(uri):
    with pytest.raises(ArgumentError, match="expected sqlite:///PATH"):
        sqlite.path_of(uri)


def test_what_a_killed_process_has_left_is_removed(tmp_path):
    database = tmp_path / "mlflow.db"
    (tmp_path / ".mlflow.db.4711").write_text("half a store")
    (tmp_path / ".mlflow.db.4711-journal").write_text("and its journal")
    sqlite.prepare(database)
    assert {path.name for path in tmp_path.iterdir()} == {"mlflow.db", ".mlflow.db.lock"}
