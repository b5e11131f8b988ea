"""A scene of two models in a folder of results; the first has training views, which it renders itself."""

from dataclasses import replace

import torch

from tests.fields.surfels.test_composition import ball
from texgs.core.camera import orbit
from texgs.core.image import write_png
from texgs.core.io import write_json
from texgs.core.light import Light
from texgs.fields.surfels.model_file import write_model
from texgs.scene.scene import Scene, SceneModel
from texgs.scene.session import Session
from texgs.volume.view_set import View, write_transforms

LIGHT = Light("directional", 10, 40)
PLACES = [(0, 0), (90, 20), (-120, -40)]  # azimuth and polar angle
SIZE = 48
COLOR = [[1.0, 1.0, 0.0, 0.0], [3.0, 0.0, 0.0, 1.0]]
TF = {"name": "TF01", "opacity": [[1.0, 0.0], [3.0, 0.5]], "color": COLOR}


def camera_at(azimuth, polar):
    return orbit(azimuth, polar, 3.0, 40.0, SIZE, SIZE)


def write_results(folder):
    models = {}
    for seed, name in enumerate(("TF01", "TF02"), 1):
        file = folder / name / "quick/texture/model.safetensors"
        models[name] = SceneModel(write_model(file, ball(seed)))
    alone = Session(Scene({"TF01": models["TF01"]}))
    views = []
    for index, place in enumerate(PLACES):
        camera = camera_at(*place)
        shown = torch.from_numpy(alone.frame(camera, scene=replace(alone.scene, light=LIGHT))) / 255
        path = write_png(folder / f"TF01/views/train/r_{index}.png", shown)
        views.append(View(camera, path, LIGHT))
    write_transforms(folder / "TF01/views", "train", views, {"tf": TF})
    write_json(folder / "volume/volume.json", {"minimum": 0, "maximum": 4, "histogram": [5] * 512})
    return Scene(models)
