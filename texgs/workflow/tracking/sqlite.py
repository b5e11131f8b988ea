"""A tracking store in one SQLite file, made or upgraded once however many jobs open it together.

MLflow itself makes the tables in each process that finds none; processes that do so at once break the file.
"""

import os
import sqlite3
import subprocess
import sys
from contextlib import closing
from pathlib import Path

from texgs.core.errors import ArgumentError
from texgs.workflow.tracking.errors import TrackingError, reason

ARTIFACTS = "mlartifacts"
# `mlflow db upgrade`, without the imports of all other commands of MLflow: a third of its time.
UPGRADE = "from mlflow.db import upgrade; upgrade()"


def path_of(uri: str) -> Path:
    """Absolute path of the file an address such as `sqlite:///results/mlflow.db` names.

    Raises:
        ArgumentError: if it names none.
    """
    path = uri.removeprefix("sqlite:///")
    if path == uri or not path or path == ":memory:" or "?" in path:
        raise ArgumentError(f"tracking: expected sqlite:///PATH with the path of a file, got {uri!r}")
    return Path(path).expanduser().resolve()


def prepare(database: Path) -> Path:
    """Make the store, or bring an older one to the schema of this MLflow, unless it is current.

    A copy of an older store is kept beside it. A store that was moved finds its files again.

    Returns:
        The folder for files of runs, beside the database.

    Raises:
        TrackingError: if the file is something else, or cannot be written.
    """
    from filelock import FileLock

    artifacts = database.with_name(ARTIFACTS)
    try:
        database.parent.mkdir(parents=True, exist_ok=True)
        newest = _newest_revision()
        if _revision(database) != newest:
            with FileLock(database.with_name(f".{database.name}.lock")):
                _bring_up(database, newest)
        _relocate(database, artifacts.as_uri())
    except (OSError, sqlite3.Error) as error:
        raise TrackingError(
            f"{database}: cannot be used as a tracking store ({reason(error)}); choose another file"
        ) from error
    return artifacts


def _newest_revision() -> str | None:
    """The schema this MLflow works with."""
    import mlflow
    from alembic.script import ScriptDirectory

    migrations = Path(mlflow.__file__).parent / "store" / "db_migrations"
    return ScriptDirectory(str(migrations)).get_current_head()


def _revision(database: Path) -> str | None:
    """The schema of a store; None where there is no file, or an empty one."""
    if not database.exists():
        return None
    with closing(_open(database)) as connection:
        tables = {
            name for (name,) in connection.execute("SELECT name FROM sqlite_master WHERE type = 'table'")
        }
        if not tables:
            return None
        if "alembic_version" in tables:
            for (revision,) in connection.execute("SELECT version_num FROM alembic_version"):
                return str(revision)
    raise TrackingError(
        f"{database}: expected a store of MLflow, got another database or half of one; choose another file"
    )


def _bring_up(database: Path, newest: str | None) -> None:
    """Make or upgrade the store; to be called under the lock."""
    revision = _revision(database)
    if revision == newest:
        return  # another process did it
    if revision is None:
        for left in database.parent.glob(f".{database.name}.[0-9]*"):  # by a process that was killed
            left.unlink()
        fresh = database.with_name(f".{database.name}.{os.getpid()}")
        try:
            _upgrade(fresh)
            fresh.replace(database)
        finally:
            fresh.unlink(missing_ok=True)
        return
    copy = database.with_name(f"{database.name}.{revision}")
    with closing(_open(database)) as old, closing(sqlite3.connect(copy)) as new:
        old.backup(new)
    _upgrade(database)


def _upgrade(database: Path) -> None:
    """Run MLflow's own upgrade, in a child because it sets up logging and prints."""
    command = [sys.executable, "-P", "-c", UPGRADE, f"sqlite:///{database}"]
    child = subprocess.run(command, capture_output=True, text=True, check=False)
    if child.returncode:
        last = (child.stderr.strip().splitlines() or ["no message"])[-1]
        raise TrackingError(
            f"{database}: MLflow cannot make or upgrade this store ({last}); "
            "install the MLflow that wrote it, or choose another file"
        )


def _relocate(database: Path, artifacts: str) -> None:
    """Point a store that was moved at the folder beside it: MLflow keeps absolute addresses only."""
    pattern = f"file:///%/{ARTIFACTS}"
    with closing(_open(database)) as connection, connection:
        moved = connection.execute(
            "SELECT DISTINCT artifact_location FROM experiments WHERE artifact_location LIKE ? "
            "AND artifact_location != ?",
            (pattern, artifacts),
        ).fetchall()
        for (old,) in moved:
            connection.execute(
                "UPDATE runs SET artifact_uri = :new || substr(artifact_uri, length(:old) + 1) "
                "WHERE substr(artifact_uri, 1, length(:old) + 1) = :old || '/'",
                {"old": old, "new": artifacts},
            )
            connection.execute(
                "UPDATE experiments SET artifact_location = ? WHERE artifact_location = ?", (artifacts, old)
            )


def _open(database: Path) -> sqlite3.Connection:
    """A connection that never makes a file and waits as long as MLflow's do."""
    return sqlite3.connect(f"{database.as_uri()}?mode=rw", uri=True, timeout=20)
