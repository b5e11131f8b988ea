import shutil

import pytest
from mlflow import MlflowClient

from texgs.workflow.tracking.sqlite import prepare


@pytest.fixture(scope="session")
def empty_store(tmp_path_factory):
    """A store without runs; making one takes seconds, so that tests copy it."""
    database = tmp_path_factory.mktemp("store") / "mlflow.db"
    prepare(database)
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
