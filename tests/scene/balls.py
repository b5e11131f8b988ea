"""A scene file of two small balls."""

from tests.fields.surfels.test_composition import ball
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import write_scene


def write_balls(folder):
    """Write scene.yaml, with the models TF01 and TF02 beside it."""
    models = {
        name: SceneModel(write_model(folder / f"{name}.safetensors", ball(seed)))
        for seed, name in enumerate(("TF01", "TF02"), 1)
    }
    return write_scene(folder / "scene.yaml", Scene(models))
