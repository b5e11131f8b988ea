"""Wrong arguments give one clear sentence; unusual but right ones work."""

import ctypes
import math
from dataclasses import replace

import pytest
import torch

from tests.raster.agreement import gradients, images, names_of, random_cotangents
from tests.raster.requirements import require_equal
from tests.raster.scenes import gaussians, random_scene, textured, textured_with_features
from tests.refusals import refused
from texgs.core.errors import ArgumentError, DeviceError, ShapeError, TexgsError
from texgs.raster import autograd, native
from texgs.raster.api import rasterize
from texgs.raster.autograd import RasterView, SurfelTensors, bin_surfels
from texgs.raster.reference import rasterize as reference
from texgs.raster.types import Options, Texture

N = 200
WRONG_SHAPES = {
    "means": torch.rand(3, N),
    "quats": torch.rand(N, 3),
    "scales": torch.rand(N, 4),
    "opacities": torch.rand(N, 1),
    "features": torch.rand(N + 1, 3),
    "viewmat": torch.eye(3),
    "K": torch.eye(4),
    "background": torch.rand(4),
    "shift": torch.zeros(N, 3),
}


@pytest.mark.parametrize("name", WRONG_SHAPES)
def test_wrong_shapes_and_types(name):
    scene = replace(random_scene(), shift=torch.zeros(N, 2))
    wrong = replace(scene, **{name: WRONG_SHAPES[name]})
    refused(lambda: wrong.render(rasterize), rf"(?i)\b{name}: expected \[.*\], got \[", ShapeError)
    for dtype in (torch.float64, torch.float16, torch.int32):
        wrong = replace(scene, **{name: getattr(scene, name).to(dtype)})
        refused(lambda wrong=wrong: wrong.render(rasterize), rf"\b{name}: expected float32")


def turned(name):
    """The scene with a matrix of its camera transposed."""
    return replace(random_scene(), **{name: getattr(random_scene(), name).T})


def seen_by(**changes):
    return replace(random_scene(), **changes)


def beside_a_texture(channels):
    return textured_with_features(random_scene(), channels)


STRETCHED = torch.cat([2 * random_scene().viewmat[:3], random_scene().viewmat[3:]])
SIZES = ((0, 5), (5, -1), (2**31, 5), (2**20 - 15, 1), (1, 2**20 - 15), (5.0, 5))
FOCAL = ((0.0, 9.0), (-10.0, 9.0), (9.0, -1.0))


@pytest.mark.parametrize(("named", "scene", "outputs", "error"), [
    *(("width, height: ", seen_by(width=width, height=height), (), ArgumentError) for width, height in SIZES),
    *((rf"{name}\[.*transpose", turned(name), (), ArgumentError) for name in ("viewmat", "K")),
    ("viewmat: .* rotation", seen_by(viewmat=STRETCHED), (), ArgumentError),
    *(("K: .*focal", seen_by(K=torch.diag(torch.tensor([*each, 1.0]))), (), ArgumentError) for each in FOCAL),
    ("'depths'", random_scene(), ("depths",), ArgumentError),
    ("outputs: .* a string", random_scene(), "depth", ArgumentError),
    ("scales: .*transpose", seen_by(scales=torch.rand(3, N)), (), ShapeError),
    ("features: .*device cpu", seen_by(features=torch.rand(N, 3, device="meta")), (), DeviceError),
    ("got meta", random_scene().to("meta"), (), DeviceError),
    *((f"32 channels, got {n}", random_scene(channels=n), (), ArgumentError) for n in (0, 33)),
    *((f"29 channels, got {n}", beside_a_texture(n), (), ArgumentError) for n in (0, 30)),
    ("background: ", replace(beside_a_texture(2), background=torch.rand(3)), (), ShapeError),
])  # fmt: skip
def test_wrong_views_outputs_and_channels(named, scene, outputs, error):
    refused(lambda: scene.render(rasterize, outputs), named, error)


@pytest.mark.parametrize("render", [rasterize, reference])
def test_what_nothing_can_draw(render):
    in_space = replace(textured(random_scene()), scales=torch.rand(N, 3))
    for named, scene, outputs in (
        ("features, a texture or both", seen_by(features=None), ()),
        *(("scales: .*3D Gaussians", seen_by(scales=torch.rand(N, columns)), ()) for columns in (1, 4)),
        ("texture: .*3D Gaussians", in_space, ()),
        ("outputs: .*normal", gaussians(random_scene()), ("depth", "normal")),
    ):
        refused(lambda scene=scene, outputs=outputs: scene.render(render, outputs), named, TexgsError)


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        ("base", torch.rand(N, 4), r"base: expected \[200, 3\], got \[200, 4\]"),
        ("gain", torch.rand(N, 1), r"gain: expected \[200\], got \[200, 1\]"),
        ("texels", torch.rand(9000), r"texels: expected \[T, 3\]"),
        ("sizes", torch.ones(N, 2), r"sizes: expected .*int32"),
        ("sizes", torch.zeros(N, 2, dtype=torch.int32), r"sizes of at least 1"),
        ("offsets", torch.zeros(N, dtype=torch.int32), r"offsets: expected .*int64"),
        ("offsets", torch.full((N,), 10**9), r"within the \d+ texels"),
        ("offsets", torch.full((N,), 2**63 - 1), r"within the \d+ texels"),
        ("offsets", torch.full((N,), -1), r"within the \d+ texels"),
    ],
)
def test_wrong_texture(name, value, error):
    scene = textured(random_scene())
    scene = replace(scene, texture=replace(scene.texture, **{name: value}))
    refused(lambda: scene.render(rasterize), error, TexgsError)


@pytest.mark.parametrize("order", ["one after the other", "mixed, with gaps"])
def test_textures_must_not_overlap(order):
    sizes = torch.tensor([(2, 3), (1, 1), (4, 4), (1, 5)], dtype=torch.int32)
    offsets = torch.tensor([0, 6, 7, 23] if order == "one after the other" else [30, 0, 50, 5])
    texture = Texture(torch.rand(4, 3), torch.rand(4), torch.rand(70, 3), sizes, offsets)
    scene = replace(random_scene(n=4), features=None, texture=texture)
    scene.render(rasterize)
    for other, texel in ((2, offsets[2] + 15), (1, offsets[1])):
        moved = torch.cat([offsets[:3], texel[None]])
        shared = replace(scene, texture=replace(texture, offsets=moved))
        refused(
            lambda shared=shared: shared.render(rasterize), f"surfels {other} and 3 sharing texel {texel}"
        )


@pytest.mark.parametrize("name", ["viewmat", "K", "background"])
def test_camera_and_background_are_constants(name):
    scene = random_scene()
    scene = replace(scene, **{name: getattr(scene, name).clone().requires_grad_()})
    refused(lambda: scene.render(rasterize), f"{name}: not differentiable")
    with torch.no_grad():
        scene.render(rasterize)


def tensors_of(scene, **changes):
    """Return the primitives of a scene for the library, which checks for itself, and what is around them."""
    leaves = scene.leaves() | changes
    layout = {} if scene.texture is None else {"sizes": scene.texture.sizes, "offsets": scene.texture.offsets}
    return SurfelTensors(**leaves), RasterView(scene.viewmat, scene.K, 8, 8, **layout)


def test_library_refuses_what_gaussians_do_not_have():
    scene, normal = gaussians(random_scene()), {"normal": torch.zeros(3, 8, 8)}
    of_texture = tensors_of(replace(textured(random_scene()), scales=scene.scales))
    refused(lambda: bin_surfels(*of_texture, {}), "texture: ")
    refused(lambda: bin_surfels(*tensors_of(scene), normal), "normal: ")
    refused(lambda: bin_surfels(*tensors_of(scene, scales=torch.rand(N, 5)), {}), "surfels: .* scales")


def test_library_refuses_what_is_not_of_the_forward_call():
    surfels, view = tensors_of(random_scene())
    images = {"color": torch.empty(surfels.channels, 8, 8), "alpha": torch.empty(8, 8)}
    frame = bin_surfels(surfels, view, images)

    def backward(surfels, **gradients):
        structures = (autograd.Image(**images), autograd.Image(**gradients), autograd.Gradients())
        given = (*view.structures(surfels), *structures)
        return lambda: native.call("texgs_backward", frame.pointer, *given, device=torch.device("cpu"))

    for name in ("depth", "median", "distortion"):
        refused(backward(surfels, **{name: images["alpha"]}), "a gradient of depth, median or distortion")
    refused(backward(SurfelTensors(*(None if x is None else x[1:] for x in surfels))), "frame: .*surfels")
    refused(lambda: autograd.contribute(frame, surfels, replace(view, width=9), None), "frame: .*image")


def test_library_refuses_colours_that_do_not_add_up():
    colored, view = tensors_of(textured_with_features(random_scene(), 2))
    bare = colored._replace(features=None)

    def forward(surfels, channels):
        structures = view.structures(surfels)
        structures[0].channels = channels
        given = (*structures, autograd.Image(), ctypes.byref(ctypes.c_void_p()))
        return lambda: native.call("texgs_forward", *given, device=torch.device("cpu"))

    refused(forward(colored, 3), "features: ")
    refused(forward(bare, 5), "features: ")
    refused(forward(colored, 2), "texture: ")
    refused(forward(bare._replace(base=None, gain=None, texels=None), 2), "surfels: ")


WRONG_OPTIONS = {
    "alpha_min": (-0.1, 1e-38, 1.5),
    "transmittance_min": (1.0, -1e-3),
    "low_pass": (0.0, math.nan),
    "filter_sigma": (-1.0,),
    "dilation": (0.0, -0.3, math.nan),
    "near": (0.0, -1.0, 200.0),  # the last: behind the far plane
}


@pytest.mark.parametrize("name", WRONG_OPTIONS)
def test_wrong_options(name):
    for value in WRONG_OPTIONS[name]:
        options = Options(**{name: value})
        refused(lambda options=options: random_scene().render(rasterize, options=options), name)


def test_memory_layout_does_not_matter(device, drawn):
    scene = drawn(replace(random_scene(), shift=torch.rand(N, 2))).to(device)
    strided = scene.map(lambda x: x.repeat_interleave(2, 0)[::2] if x.ndim == 1 else x.T.contiguous().T)
    assert not strided.means.is_contiguous()
    expected, result = (images(s.render(rasterize, scene.outputs)) for s in (scene, strided))
    cotangents = random_cotangents(scene, names_of(scene))
    expected |= gradients(rasterize, scene, cotangents)
    result |= gradients(rasterize, strided, cotangents)
    require_equal(result, expected)
    half = torch.tensor(0.5, device=device)
    expanded, dense = (replace(scene, opacities=x) for x in (half.expand(N), half.repeat(N)))
    assert torch.equal(expanded.render(rasterize).color, dense.render(rasterize).color)


def test_inputs_are_left_alone(device):
    scene = textured(random_scene()).to(device)
    copy = scene.map(torch.clone)
    gradients(rasterize, scene, random_cotangents(scene, ("color", "depth")))
    require_equal(scene.leaves(), copy.leaves())


def test_camera_changed_before_backward():
    scene = random_scene()
    scene = replace(scene, viewmat=scene.viewmat.clone(), means=scene.means.clone().requires_grad_())
    color = scene.render(rasterize).color
    scene.viewmat[0, 3] += 0.1
    refused(color.sum().backward, "modified by an inplace operation", RuntimeError)


def test_infinitely_far_plane(device):
    scene, far = random_scene().to(device), Options(far=float("inf"))
    expected = scene.render(rasterize, ("distortion",), Options(far=1e9)).distortion
    torch.testing.assert_close(scene.render(rasterize, ("distortion",), far).distortion, expected)
