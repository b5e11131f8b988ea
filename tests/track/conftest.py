import logging
import os
import shutil

import mlflow
import pytest
from mlflow import MlflowClient

from texgs.workflow.runs import opened


@pytest.fixture(scope="session", autouse=True)
def patience_of_users():
    """Put back what the first use of MLflow sets for the whole process, for other tests."""
    before = dict(os.environ)
    yield
    for name in os.environ.keys() - before.keys():
        if name.startswith("MLFLOW_"):
            del os.environ[name]


@pytest.fixture(autouse=True)
def no_active_run():
    """End the runs that a test has left in this process."""
    yield
    while mlflow.active_run():
        mlflow.end_run()


@pytest.fixture(scope="session")
def empty_store(tmp_path_factory):
    """A store without runs; making one takes seconds, so that tests copy it."""
    database = tmp_path_factory.mktemp("store") / "mlflow.db"
    opened(f"sqlite:///{database}", "elsewhere")
    return database


@pytest.fixture
def database(tmp_path, empty_store):
    """A store of its own for each test."""
    return shutil.copy(empty_store, tmp_path / "mlflow.db")


@pytest.fixture
def uri(database):
    return f"sqlite:///{database}"


@pytest.fixture
def client(uri):
    """Reads the store with MLflow's own client."""
    return MlflowClient(tracking_uri=uri)


@pytest.fixture
def warnings(caplog):
    """Lines of the logger of texgs."""
    caplog.set_level(logging.WARNING, logger="texgs")
    return lambda: [entry.getMessage() for entry in caplog.records if entry.name == "texgs"]
