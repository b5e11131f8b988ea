"""NaN, infinite and absurd inputs: named when checks are on, never a crash or a hang."""

from contextlib import suppress
from dataclasses import replace

import pytest
import torch

from tests.raster.agreement import gradients, names_of, random_cotangents
from tests.raster.scenes import PRIMITIVES, random_scene, textured
from tests.refusals import refused
from texgs.core.errors import ArgumentError
from texgs.raster.api import rasterize, splat
from texgs.raster.types import Options

TENSORS = ("means", "quats", "scales", "opacities", "shift", "features", "viewmat", "K", "background")
BAD = (float("nan"), float("inf"), -float("inf"))
ABSURD = (0.0, -1.0, 1e38, -1e38, 1e-38, 1e20)


def spoiled(name, value, everywhere=False, n=200, drawn=lambda scene: scene):
    """A scene of n surfels, or what is `drawn`, in which one number, or all, of one tensor is `value`."""
    scene = drawn(replace(random_scene(n=n), shift=torch.zeros(n, 2)))
    tensor = getattr(scene, name).clone()
    tensor.view(-1)[slice(None) if everywhere else 2] = value
    return replace(scene, **{name: tensor})


@pytest.mark.parametrize("name", [*TENSORS, "base", "gain", "texels"])
def test_reported_by_name(device, name):
    for value in BAD:
        scene = spoiled(name, value) if name in TENSORS else spoiled_texture(name, value)
        kind = "1 NaN and 0 infinite" if value != value else "0 NaN and 1 infinite"
        checked = scene.to(device)
        refused(
            lambda scene=checked: scene.render(rasterize, options=Options(check_finite=True)),
            f"{name}: expected finite values, got {kind}",
        )


def spoiled_texture(name, value):
    """A textured scene in which one number of one tensor of its texture is `value`."""
    scene = textured(random_scene())
    tensor = getattr(scene.texture, name).clone()
    tensor.view(-1)[5] = value
    return replace(scene, texture=replace(scene.texture, **{name: tensor}))


def test_finite_inputs_pass_the_check_and_images_to_splat_are_checked(device):
    scene = random_scene().to(device)
    checked = scene.render(rasterize, options=Options(check_finite=True))
    assert torch.equal(checked.color, scene.render(rasterize).color)
    splatted = {**scene.geometry(), "options": Options(check_finite=True)}
    for _ in range(8):  # memory that was NaN is handed out again
        torch.full((200, 1), float("nan"), device=device)
        splat(checked.color.detach(), **splatted)
    image = torch.full((37, 53, 1), float("nan"), device=device)
    refused(lambda: splat(image, **splatted), "image: expected finite values")


@pytest.mark.parametrize("everywhere", [False, True], ids=["one", "all"])
@pytest.mark.parametrize("name", TENSORS)
@pytest.mark.parametrize("kind", [*PRIMITIVES.values(), textured], ids=[*PRIMITIVES, "textured"])
def test_no_crash(device, kind, name, everywhere):
    for value in BAD + ABSURD:
        scene = kind(spoiled(name, value, everywhere, 50)).to(device)
        with suppress(ArgumentError):  # a skewed K, or one without its last row, is refused
            scene.render(rasterize, scene.outputs, Options(antialiased=True))
            gradients(rasterize, scene, random_cotangents(scene, names_of(scene)))


def test_no_crash_on_spoiled_gradients(device, drawn):
    scene = drawn(random_scene()).to(device)
    for value in BAD:
        cotangents = random_cotangents(scene, names_of(scene))
        cotangents = {name: torch.full_like(x, value) for name, x in cotangents.items()}
        gradients(rasterize, scene, cotangents)


@pytest.mark.parametrize("name", ["means", "quats", "scales", "opacities"])
@pytest.mark.parametrize("value", BAD)
def test_one_bad_surfel_does_not_spoil_the_others(device, drawn, name, value):
    if (name, value) == ("opacities", float("inf")):
        pytest.skip("an infinite opacity is as good as 0.99 and hides what lies behind")
    scene = spoiled(name, value, drawn=drawn).to(device)
    bad = 2 // (getattr(scene, name)[0].numel())
    others = [i for i in range(200) if i != bad]
    alone = scene.with_leaves({tensor: leaf[others] for tensor, leaf in scene.leaves().items()})
    color, expected = (shown.render(rasterize).color for shown in (scene, alone))
    torch.testing.assert_close(color, expected, rtol=0, atol=1e-6)


@pytest.mark.parametrize("scale", [1e-18, 1e-20, 1e-22, 1e-23, 1e-24, 1e-26])
def test_surfels_of_no_size_have_finite_gradients(device, scale):
    """Squares of such lengths are smaller than the smallest floats."""
    scene = random_scene(n=50).to(device)
    scene = replace(scene, scales=torch.full_like(scene.scales, scale))
    derivatives = gradients(rasterize, scene, random_cotangents(scene, ("color",)))
    assert all(bool(gradient.isfinite().all()) for gradient in derivatives.values())


def test_a_gain_that_is_not_finite_leaves_other_textures_their_gradients(device):
    """As of a surfel without a direction, which is not drawn."""
    scene = textured(random_scene(n=50))
    quats, gain = scene.quats.clone(), scene.texture.gain.clone()
    quats[7], gain[7] = 0.0, float("nan")
    scene = replace(scene, quats=quats, texture=replace(scene.texture, gain=gain)).to(device)
    texels = gradients(rasterize, scene, random_cotangents(scene, ("color",)))["texels"]
    own = torch.zeros(len(texels), dtype=torch.bool, device=device)
    first, count = int(scene.texture.offsets[7]), int(scene.texture.sizes[7].prod())
    own[first : first + count] = True
    assert bool(texels[~own].isfinite().all())
    assert bool((texels[~own] != 0).any())
