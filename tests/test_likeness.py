"""Parts of benchmarks/likeness.py that need no weights."""

import pytest
import torch

from benchmarks.likeness import CELL, DEEP, deep_gram, picture
from tests.edit.scenes import ball, views
from tests.models.networks import random_weights
from texgs.models.vgg import Vgg


def test_a_picture_is_cut_to_the_object():
    (camera, *_), (light, *_) = views(2)
    shown, full = picture(ball(), camera, light), ball().render(camera, light)
    assert shown.shape == (3, CELL, CELL)
    filled, before = (shown.mean(0) < 0.99).float(), (full.alpha > 0.02).float()
    assert float(filled.mean()) > 1.5 * float(before.mean())
    assert bool(filled[[CELL // 6, -CELL // 6]].any(1).all() and filled[:, [CELL // 6, -CELL // 6]].any())


def test_deep_features_are_compared_on_the_object_alone(tmp_path):
    torch.save(random_weights(last=21), tmp_path / "vgg.pth")
    vgg = Vgg.load(tmp_path / "vgg.pth", layers=DEEP, dtype=torch.float32)
    cameras, lights = views(2)
    style = torch.rand(3, 64, 64, generator=torch.Generator().manual_seed(0))
    maps, expected = vgg.features(style).flatten(1).double(), []
    for camera, light in zip(cameras, lights, strict=True):
        shown = ball().render(camera, light)
        seen = vgg.features(shown.color.clamp(0, 1).permute(2, 0, 1)).double()
        on = shown.alpha.unfold(0, 8, 8).unfold(1, 8, 8).mean((2, 3)) > 0.5
        ours, target = seen[:, on] @ seen[:, on].T / int(on.sum()), maps @ maps.T / maps.shape[1]
        expected.append(float((ours - target).norm() / target.norm()))
    assert deep_gram(ball(), cameras, lights, style, vgg) == pytest.approx(sum(expected) / 2, rel=1e-4)
