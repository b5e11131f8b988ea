"""PSNR and SSIM of images and of models, and views that are read ahead: order, errors, and how far."""

import math
import threading
from math import log10
from statistics import fmean

import pytest
import torch

from texgs.core.camera import orbit
from texgs.core.image import write_png
from texgs.core.light import Light
from texgs.fields.surfels.model import Surfels
from texgs.fields.surfels.shading import raw_material
from texgs.metrics.quality import compare, evaluate, mean, psnr, read_ahead, ssim
from texgs.raster import Render
from texgs.raster.reference.losses import ssim as reference_ssim
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


def test_a_model_is_almost_its_own_pictures(tmp_path):
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
    visible = fmean([float((view.load()[..., 3] > 2).float().mean()) for view in views])
    assert visible < 0.3
    assert mean(scores)["object_psnr"] == pytest.approx(mean(scores)["psnr"] + 10 * log10(visible), abs=0.3)
    assert mean(scores)["shown"] > 0.999
    write_png(tmp_path / "opaque.png", model.render(camera, light).color)
    assert evaluate(model, [View(camera, tmp_path / "opaque.png", light)])["object_psnr"] == []
    halved = evaluate(model, views, reduce=2)
    assert 15 < mean(halved)["psnr"] < 48


def test_the_object_is_what_one_of_two_images_shows():
    """Errors elsewhere do not count; with none elsewhere, the squared error is on a share of the pixels."""
    generator = torch.Generator().manual_seed(2)
    target = torch.rand(40, 40, 3, generator=generator)
    image, alpha, other = target.clone(), torch.zeros(40, 40), torch.zeros(40, 40)
    alpha[:20, :20], other[:20, 20:] = 0.02, 1.0
    image[:20] += 0.1 * (torch.rand(20, 40, 3, generator=generator) - 0.5)
    scores = compare(Render(image, alpha), Render(target, other))
    assert scores["object_psnr"] == pytest.approx(scores["psnr"] - 10 * log10(2), abs=0.05)
    assert scores["object_ssim"] < scores["ssim"] < 1
    image[25:] += 0.3
    worse = compare(Render(image, alpha), Render(target, other))
    assert worse["psnr"] < scores["psnr"] - 3
    assert worse["object_psnr"] == scores["object_psnr"]
    assert worse["object_ssim"] == pytest.approx(scores["object_ssim"], abs=1e-6), "windows are not reached"
    assert set(compare(Render(image, 0 * alpha), Render(target, 0 * other))) == {"psnr", "ssim"}


def test_psnr_is_of_clamped_values_over_all_pixels_and_channels():
    target = torch.full((4, 5, 3), 0.5)
    assert psnr(target + 0.1, target) == pytest.approx(20, abs=1e-4)
    assert psnr(target, target) == 100
    assert math.isnan(psnr(target * math.nan, target)), "not the best value"
    white = torch.ones(3, 3, 3)
    assert psnr(white + 7, white) == 100
    assert psnr(torch.full_like(white, -3.0), white) == pytest.approx(0, abs=1e-6)
    target = torch.zeros(10, 10, 3)
    image = target.clone()
    image[0, 0, 0] = 1
    assert psnr(image, target) == pytest.approx(10 * math.log10(300), abs=1e-4)


def test_ssim_is_the_reference():
    generator = torch.Generator().manual_seed(0)
    image, target = torch.rand(2, 20, 24, 3, generator=generator)
    expected = reference_ssim(image.double(), target.double())
    assert ssim(image, target) == pytest.approx(float(expected), abs=1e-5)
    assert ssim(target, target) == 1


def test_the_next_one_is_read_meanwhile_and_no_other():
    begun = [threading.Event() for _ in range(4)]

    def read(index):
        begun[index].set()
        return index

    for expected, (index, known) in enumerate(read_ahead(read, range(4))):
        assert index == known == expected
        assert index == 3 or begun[index + 1].wait(10)
        assert not any(event.is_set() for event in begun[index + 2 :])


def test_an_error_comes_in_its_place():
    items = read_ahead(lambda x: 1 / x, [1, 2, 0, 4])
    assert [next(items), next(items)] == [(1, 1), (2, 0.5)]
    with pytest.raises(ZeroDivisionError):
        next(items)
