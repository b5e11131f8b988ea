"""A scene of two small balls in a folder of its own."""

import pytest

from tests.scene.balls import write_balls


@pytest.fixture
def scene_file(tmp_path):
    return write_balls(tmp_path)
