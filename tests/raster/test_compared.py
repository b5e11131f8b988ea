"""The loss of a view in one pass is that of its parts, which have tests of their own, with their gradients."""

from dataclasses import replace

import pytest
import torch
from torch.testing import assert_close

from tests.raster.requirements import refuses, require_same_bits
from tests.raster.scenes import random_scene
from texgs.core.camera import Camera
from texgs.core.errors import ShapeError
from texgs.raster import rasterize
from texgs.raster.compared import Comparison, rendered_loss
from texgs.raster.losses import bilateral_smoothness, l1_dssim, normal_consistency, ssim

NAMES = ("means", "quats", "scales", "opacities", "features")
WEIGHTS = {"l1": 0.8, "dssim": 0.2, "alpha_l1": 0.05, "alpha_dssim": 0.3, "normal": 0.7, "smoothness": 0.6}


def given(drawn=lambda scene: scene, channels=7, n=60, **size):
    """A scene, its raw parameters, and what it is compared with."""
    generator = torch.Generator().manual_seed(4)
    scene = drawn(random_scene(2, n=n, **size))
    scene = replace(scene, features=torch.rand(n, channels, generator=generator), texture=None, shift=None)
    scene = replace(scene, background=torch.tensor([1.0] * 3 + [0.0] * (channels - 3)))
    planes = torch.rand(4, scene.height, scene.width, generator=generator)
    raw = {name: getattr(scene, name) for name in NAMES}
    raw |= {"scales": raw["scales"].log(), "opacities": raw["opacities"].clamp(1e-3, 1 - 1e-3).logit()}
    weights = WEIGHTS if scene.scales.shape[1] == 2 else WEIGHTS | {"normal": 0.0}
    return scene, raw, Comparison(planes[:3].permute(1, 2, 0), planes[3], **weights)


def camera_of(scene):
    return Camera(scene.viewmat, scene.K, scene.width, scene.height)


def in_one_pass(scene, raw, comparison, shift_gradient=None):
    leaves = {name: x.clone().requires_grad_() for name, x in raw.items()}
    *geometry, features = leaves.values()
    loss = rendered_loss(tuple(geometry), features, camera_of(scene), comparison, shift_gradient)
    (2 * loss).backward()
    return {"loss": loss.detach(), **{name: x.grad for name, x in leaves.items()}}


def by_parts(scene, raw, c):
    leaves = {name: x.clone().requires_grad_() for name, x in raw.items()}
    shift = torch.zeros(len(raw["means"]), 2, requires_grad=True)
    natural = {**leaves, "scales": leaves["scales"].exp(), "opacities": leaves["opacities"].sigmoid()}
    outputs = ("normal", "depth") if c.normal > 0 else ()
    seen = replace(scene, **natural, shift=shift).render(rasterize, outputs)
    loss = c.l1 * l1_dssim(seen.color[..., :3], c.color, 0) + c.dssim * (1 - ssim(seen.color[..., :3], c.color))
    loss = loss + c.alpha_l1 * l1_dssim(seen.alpha, c.alpha, 0) + c.alpha_dssim * (1 - ssim(seen.alpha, c.alpha))
    if c.normal > 0:
        drawn = (seen.normal, seen.depth, seen.alpha)
        loss = loss + c.normal * normal_consistency(*drawn, scene.viewmat, scene.K)
    if seen.color.shape[2] > 3:
        loss = loss + c.smoothness * bilateral_smoothness(seen.color[..., 3:], c.color, c.alpha)
    (2 * loss).backward()
    return {"loss": loss.detach(), **{name: x.grad for name, x in leaves.items()}}, shift.grad / 2


@pytest.mark.parametrize("channels", [3, 7])
def test_loss_and_gradients_are_those_of_the_parts(channels, drawn, device):
    scene, raw, comparison = given(drawn, channels)
    shift_gradient = torch.full((len(raw["means"]), 2), torch.nan)
    together = in_one_pass(scene, raw, comparison, shift_gradient)
    expected, shifted = by_parts(scene, raw, comparison)
    for name, x in {**expected, "shift": shifted}.items():
        scale = float(x.abs().max())
        value = {**together, "shift": shift_gradient}[name]
        assert_close(value, x, rtol=2e-4, atol=2e-5 * scale, msg=lambda m, n=name: f"{n}: {m}")


def test_what_counts_nothing_is_left_out():
    scene, raw, comparison = given(channels=3)
    alone = comparison._replace(alpha_l1=0.0, alpha_dssim=0.0, normal=0.0)
    assert_close(in_one_pass(scene, raw, alone)["loss"], by_parts(scene, raw, alone)[0]["loss"])


def test_any_number_of_threads_gives_the_same_bits():
    require_same_bits(in_one_pass, *given(n=3000, width=200, height=150))


def test_without_gradients_the_value_is_the_same():
    scene, raw, comparison = given()
    loss = in_one_pass(scene, raw, comparison)["loss"]
    with torch.no_grad():
        *geometry, features = raw.values()
        value = rendered_loss(tuple(geometry), features, camera_of(scene), comparison)
    assert torch.equal(value, loss)


def test_a_target_of_another_size_is_refused():
    scene, raw, comparison = given()
    refuses(ShapeError, "alpha", in_one_pass, scene, raw, comparison._replace(alpha=torch.zeros(2, 2)))
