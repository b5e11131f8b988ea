"""Measures of scenes that leave some of them undefined."""

import torch

from tests.fields.surfels.test_composition import ball
from texgs.cli.stages.edit_metrics import agreement
from texgs.config.fields import kinds
from texgs.fields.surfels.composition import Composition
from texgs.fields.surfels.model import Surfels
from texgs.scene.scene import Scene, SceneModel
from texgs.volume.cameras import spiral as path


def test_a_scene_that_is_nowhere_opaque_has_no_consistency(tmp_path):
    model = ball(1)
    faint = torch.full_like(model.parameters["opacities"], -6.0)
    scene, cameras = Scene({"ball": SceneModel(tmp_path)}), path(12, 4.0, 30.0, 32, 32)
    missing = {"vgg16": None, "lpips_vgg": None}
    seen, unseen = (
        agreement(
            Composition([Surfels({**model.parameters, **change}, model.shading)]),
            scene,
            cameras,
            4,
            missing,
            kinds()["surfels"],
        )
        for change in ({}, {"opacities": faint})
    )
    assert 0 < seen["short_rmse"] < 0.5
    assert unseen == {"short_rmse": None, "short_lpips": None, "long_rmse": None, "long_lpips": None}
