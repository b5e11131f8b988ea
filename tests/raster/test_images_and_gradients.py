"""Images and gradients of the native rasterizer against the definition in float64, all thresholds on."""

from dataclasses import replace

import pytest
import torch

from tests.raster.agreement import IMAGES, check_gradients, check_images
from tests.raster.scenes import (
    GAUSSIAN_OPTIONS,
    OTHER_OPTIONS,
    PRIMITIVES,
    SURFEL_OPTIONS,
    TEXTURE_SIZES,
    described,
    random_scene,
    textured,
    textured_with_features,
)
from texgs.raster.api import rasterize
from texgs.raster.types import Options


def shifted(scene, length):
    """Return the scene, shifted at random."""
    shift = torch.randn(len(scene.means), 2, generator=torch.Generator().manual_seed(0))
    return replace(scene, shift=length * shift)


def with_some_behind(scene):
    """Return the scene with every third primitive behind the camera."""
    behind = (torch.arange(len(scene.means)) % 3 == 0)[:, None]
    return replace(scene, means=torch.where(behind, scene.means - 10 * scene.viewmat[2, :3], scene.means))


SIZES = ((0, 150, 53, 37), (1, 300, 64, 48), (2, 400, 33, 71))  # seed, number of primitives, of pixels
OF_BOTH = {  # a scene, and images whose gradients are compared
    **{f"{size}": (random_scene(*size), ("color",)) for size in SIZES},
    **{f"{n} channels": (random_scene(5, channels=n), ("color",)) for n in (1, 2, 3, 4, 5, 6)},
    **{f"{n} and depth": (random_scene(5, channels=n), ("color", "depth")) for n in (1, 4, 7, 16, 32)},
    **{name: (random_scene(3), (name,)) for name in IMAGES[1:]},
    "all images": (random_scene(4), IMAGES),
    "shift": (shifted(random_scene(7), 1), ("color", "depth")),
    "large shift": (shifted(random_scene(9), 3), ("color",)),
    "no shift": (shifted(random_scene(7), 0), ("color",)),
    "black": (replace(random_scene(8), background=None), ("color",)),
    "behind": (with_some_behind(random_scene(13)), ("color",)),
    "one row of pixels": (random_scene(3, 200, 17, 1), ()),
}
TEXTURED = {
    **{f"{size}": (textured(random_scene(9), [size]), ("color", "depth")) for size in TEXTURE_SIZES},
    "mixed": (textured(random_scene(8)), ("color",)),  # geometry included, through texture coordinates
    "all images": (replace(textured(random_scene(10)), shift=torch.zeros(200, 2)), IMAGES),
    "black": (textured(replace(random_scene(8), background=None)), ("color",)),
    **{f"and {n}": (textured_with_features(random_scene(10), n), ("color",)) for n in (1, 3, 4, 13, 29)},
    "and all": (textured_with_features(random_scene(10), 4), ("color", "normal", "depth")),
}


@pytest.mark.parametrize("name", OF_BOTH)
def test_scenes(device, drawn, name):
    scene, compared = OF_BOTH[name]
    check_images(drawn(scene), device)
    check_gradients(drawn(scene), device, compared)


@pytest.mark.parametrize("name", TEXTURED)
def test_textures(device, name):
    scene, compared = TEXTURED[name]
    check_images(scene, device)
    check_gradients(scene, device, compared)


OPTIONS = [("surfels", options) for options in SURFEL_OPTIONS + OTHER_OPTIONS]
OPTIONS += [("gaussians", options) for options in GAUSSIAN_OPTIONS + OTHER_OPTIONS]


@pytest.mark.parametrize(
    ("kind", "options"), OPTIONS, ids=lambda x: x if isinstance(x, str) else described(x)
)
def test_options(device, kind, options):
    check_images(PRIMITIVES[kind](random_scene(4)), device, options)
    if options not in OTHER_OPTIONS:
        check_gradients(PRIMITIVES[kind](random_scene(6)), device, ("color", "depth", "normal"), options)


def test_texture_on_unfiltered_and_narrow_surfels(device):
    check_images(textured(random_scene(7)), device, Options(low_pass=64.0, filter_sigma=1.0))


def test_only_what_is_asked_for(device, drawn):
    scene = drawn(random_scene()).to(device)
    render = scene.render(rasterize)
    assert render.depth is render.median is render.normal is render.distortion is render.statistics is None
    alone = scene.render(rasterize, ("depth",))
    together = scene.render(rasterize, scene.outputs)
    assert alone.normal is None
    torch.testing.assert_close(alone.depth, together.depth)
    torch.testing.assert_close(alone.color, together.color)


@pytest.mark.parametrize(
    "wanted", [("features",), ("opacities",), ("means", "features"), ("quats", "scales")]
)
def test_some_gradients_only(device, drawn, wanted):
    check_gradients(drawn(random_scene(11)), device, ("color", "normal"), wanted=wanted)


SOME_OF_TEXTURES = {  # by the number of features beside the texture
    0: [("texels",), ("base", "gain"), ("gain", "texels", "opacities")],
    2: [("features",), ("texels",), ("features", "texels"), ("base", "features")],
}


@pytest.mark.parametrize(
    ("channels", "wanted"), [(n, some) for n, cases in SOME_OF_TEXTURES.items() for some in cases]
)
def test_some_gradients_of_textures_only(device, channels, wanted):
    scene = random_scene(12)
    scene = textured_with_features(scene, channels) if channels else textured(scene)
    check_gradients(scene, device, wanted=wanted)


def test_two_uses_of_one_image_and_two_images_of_one_scene(device, drawn):
    scene = drawn(random_scene(14)).to(device)
    means = scene.means.clone().requires_grad_()
    first = scene.with_leaves({"means": means}).render(rasterize)
    second = replace(scene.with_leaves({"means": means}), background=None).render(rasterize)
    both = torch.autograd.grad(first.color.sum() + (second.color**2).sum(), means, retain_graph=True)[0]
    one = torch.autograd.grad(first.color.sum(), means)[0]
    other = torch.autograd.grad((second.color**2).sum(), means)[0]
    torch.testing.assert_close(both, one + other)
