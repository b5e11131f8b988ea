"""A scene of two small balls in a folder of its own, and a server of it."""

import pytest

from tests.fields.surfels.test_composition import ball
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import write_scene


@pytest.fixture
def scene_file(tmp_path):
    models = {}
    for index, name in enumerate(("TF01", "TF02")):
        path = write_model(tmp_path / f"{name}.safetensors", ball(index + 1))
        models[name] = SceneModel(path)
    return write_scene(tmp_path / "scene.yaml", Scene(models))
