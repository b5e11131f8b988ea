"""Scenes of small balls."""

import math

import torch

from tests.fields.surfels.test_composition import ball
from tests.scene.test_twin import HIGH, LOW, sphere_volume
from texgs.core.geometry import facing
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


def balls_in_a_volume(folder, **options):
    """A scene of the balls `low` and `high`, with a sphere as their volume."""
    volume = sphere_volume(folder, low=LOW, high=HIGH)
    return Scene(ball_models(folder, "low", "high"), volume=volume, **options)


def shell(normals, radius, size, opacity, middle=(0.0, 0.0, 0.0)):
    """Geometry of round surfels on a sphere, whose normals [N, 3] point out of it; raw opacity."""
    n = len(normals)
    return {
        "means": torch.as_tensor(middle, dtype=torch.float32) + radius * normals,
        "quats": facing(normals),
        "scales": torch.full((n, 2), math.log(size)),
        "opacities": torch.full((n,), opacity),
    }
