"""Scenes of small balls."""

from tests.fields.surfels.test_composition import ball
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.scene_file import write_scene


def ball_models(folder, *names):
    """Models of scenes by name, each a ball of its own."""
    return {
        name: SceneModel(write_model(folder / f"{name}.safetensors", ball(seed)))
        for seed, name in enumerate(names, 1)
    }


def write_balls(folder):
    """Write scene.yaml, with the models TF01 and TF02 beside it."""
    return write_scene(folder / "scene.yaml", Scene(ball_models(folder, "TF01", "TF02")))
