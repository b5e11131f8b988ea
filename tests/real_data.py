"""Real volumes and views for tests that need them; such a test skips where they are absent."""

import os
from pathlib import Path

import pytest

# TEXGS_TEST_DATA, or a folder `shared/data` beside the project.
FOLDER = Path(os.environ.get("TEXGS_TEST_DATA") or Path(__file__).parents[2] / "shared" / "data")


def real_data(name: str) -> Path:
    """Path of a file or folder below the test data; skips the test where it does not exist."""
    path = FOLDER / name
    if not path.exists():
        pytest.skip(f"{name} is not in {FOLDER}; set TEXGS_TEST_DATA to the folder that holds it")
    return path
