from pathlib import Path

import pytest
import torch

from texgs.core.camera import orbit
from texgs.core.image import write_png
from texgs.core.light import Light
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import raw_material
from texgs.metrics.quality import evaluate, mean
from texgs.volume.view_set import View


def ball():
    generator = torch.Generator().manual_seed(1)
    means = 0.3 * torch.nn.functional.normalize(torch.randn(200, 3, generator=generator), dim=1)
    return Surfels(
        {
            "means": means,
            "quats": torch.randn(200, 4, generator=generator),
            "scales": torch.full((200, 2), -3.0),
            "opacities": torch.full((200,), 2.0),
            "colors": torch.rand(200, 3, generator=generator),
            **raw_material(0.4, 0.5, 0.2, 20, "bounded"),
        }
    )


def test_a_model_is_almost_its_own_pictures(tmp_path: Path):
    model, light = ball(), Light("headlight")
    views = []
    for index in range(3):
        camera = orbit(120.0 * index, 20, 4, 20, 32, 24)
        seen = model.render(camera, light, background=torch.zeros(3))
        write_png(tmp_path / f"{index}.png", seen.color, seen.alpha)
        views.append(View(camera, tmp_path / f"{index}.png", light))
    scores = evaluate(model, views)
    assert len(scores["psnr"]) == 3
    assert mean(scores)["psnr"] > 48, "only rounding to 8 bits is between them"
    assert mean(scores)["ssim"] > 0.999
    halved = evaluate(model, views, reduce=2)
    assert 15 < mean(halved)["psnr"] < 48


def test_mean():
    assert mean({"psnr": [1.0, 3.0], "ssim": []}) == {"psnr": pytest.approx(2.0)}
