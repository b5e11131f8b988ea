"""Wrong arguments give one clear sentence; unusual but right ones work."""

import ctypes
import math
from dataclasses import replace

import pytest
import torch

from tests.raster.agreement import gradients, images, names_of, random_cotangents
from tests.raster.requirements import refuses
from tests.raster.scenes import gaussians, random_scene, textured, textured_with_features
from texgs.core.errors import ArgumentError, DeviceError, ShapeError, TexgsError
from texgs.raster import autograd, native
from texgs.raster.api import rasterize, splat
from texgs.raster.autograd import SurfelTensors, View, bin_surfels
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
def test_wrong_shape(device, name):
    scene = replace(random_scene(), **{name: WRONG_SHAPES[name]}).to(device)
    refuses(ShapeError, rf"(?i)\b{name}: expected \[.*\], got \[", scene.render, rasterize)


@pytest.mark.parametrize("name", WRONG_SHAPES)
@pytest.mark.parametrize("dtype", [torch.float64, torch.float16, torch.int32])
def test_wrong_dtype(device, name, dtype):
    scene = replace(random_scene(), shift=torch.zeros(N, 2))
    scene = replace(scene, **{name: getattr(scene, name).to(dtype)}).to(device)
    refuses(ArgumentError, rf"\b{name}: expected float32, got {str(dtype)[6:]}", scene.render, rasterize)


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
    refuses(TexgsError, error, scene.render, rasterize)


@pytest.mark.parametrize("order", ["one after the other", "mixed, with gaps"])
def test_textures_must_not_overlap(order):
    sizes = torch.tensor([(2, 3), (1, 1), (4, 4), (1, 5)], dtype=torch.int32)
    offsets = torch.tensor([0, 6, 7, 23] if order == "one after the other" else [30, 0, 50, 5])
    texture = Texture(torch.rand(4, 3), torch.rand(4), torch.rand(70, 3), sizes, offsets)
    scene = replace(random_scene(n=4), features=None, texture=texture)
    scene.render(rasterize)
    for other, texel in ((2, offsets[2] + 15), (1, offsets[1])):
        moved = torch.cat([offsets[:3], texel[None]])
        with pytest.raises(ArgumentError, match=rf"surfels {other} and 3 sharing texel {texel}"):
            replace(scene, texture=replace(texture, offsets=moved)).render(rasterize)


@pytest.mark.parametrize("name", ["viewmat", "K", "background"])
def test_camera_and_background_are_constants(device, name):
    scene = random_scene().to(device)
    scene = replace(scene, **{name: getattr(scene, name).clone().requires_grad_()})
    refuses(ArgumentError, rf"{name}: not differentiable .* pass {name}.detach\(\)", scene.render, rasterize)
    with torch.no_grad():
        scene.render(rasterize)


@pytest.mark.parametrize("render", [rasterize, reference])
def test_what_nothing_can_draw(render):
    def refused(message, scene, outputs=()):
        refuses((ArgumentError, ShapeError), message, scene.render, render, outputs)

    scene = random_scene()
    refused("expected features, a texture or both, got neither", replace(scene, features=None))
    for columns in (1, 4):
        message = r"scales: expected \[N, 2\] or \[N, 3\], got \[200, .*; 2 draw surfels, 3 draw 3D Gaussians"
        refused(message, replace(scene, scales=torch.rand(N, columns)))
    in_space = replace(textured(scene), scales=torch.rand(N, 3))
    refused(r"texture: expected features for 3D Gaussians .* to draw surfels", in_space)
    refused(r"outputs: 3D Gaussians .* have no normal; leave it out", gaussians(scene), ("depth", "normal"))


def test_wrong_sizes_cameras_and_outputs():
    scene = random_scene()

    def refused(message, outputs=(), error=ArgumentError, **changes):
        refuses(error, message, replace(scene, **changes).render, rasterize, outputs)

    for width, height in ((0, 5), (5, -1), (2**31, 5), (2**20 - 15, 1), (1, 2**20 - 15)):
        refused("width, height: expected 1 to", width=width, height=height)
    refused(r"width, height: expected whole numbers, got 5\.0", width=5.0)
    refused(r"viewmat\[.*did you transpose\?", viewmat=scene.viewmat.T)
    refused(r"K\[.*did you transpose\?", K=scene.K.T)
    stretched = torch.cat([2 * scene.viewmat[:3], scene.viewmat[3:]])
    refused("viewmat: expected a rotation and a shift, got axes .*; normalise them", viewmat=stretched)
    for fx, fy in ((0.0, 9.0), (-10.0, 9.0), (9.0, -1.0)):
        message = rf"K: expected focal lengths above 0, got .*= {min(fx, fy)}"
        refused(message, K=torch.diag(torch.tensor([fx, fy, 1.0])))
    refused("'depths'", ("depths",))
    refused(r"outputs: .* got a string; pass \('depth',\)", "depth")
    refused(r"scales: .*\[200, 2\|3\], .*; did you transpose", (), ShapeError, scales=torch.rand(3, N))
    refused("features: expected device cpu", (), DeviceError, features=torch.rand(N, 3, device="meta"))
    refuses(DeviceError, "cpu or cuda, got meta", scene.to("meta").render, rasterize)


def test_wrong_numbers_of_channels():
    scene = random_scene()
    for channels in (0, 33):
        message, image = f"1 to 32 channels, got {channels}", torch.zeros(5, 5, channels)
        refuses(ArgumentError, message, random_scene(channels=channels).render, rasterize)
        refuses(ArgumentError, message, splat, image, **scene.geometry())
    for channels in (0, 30):
        message = f"features: expected 1 to 29 channels, got {channels}"
        refuses(ArgumentError, message, textured_with_features(scene, channels).render, rasterize)
    beside = replace(textured_with_features(scene, 2), background=torch.rand(3))
    refuses(ShapeError, r"background: expected \[5\], got \[3\]", beside.render, rasterize)


def tensors_of(scene, **changes):
    """Return the primitives of a scene for the library, which checks for itself, and what is around them."""
    leaves = scene.leaves() | changes
    layout = {} if scene.texture is None else {"sizes": scene.texture.sizes, "offsets": scene.texture.offsets}
    return SurfelTensors(**leaves), View(scene.viewmat, scene.K, 8, 8, **layout)


def test_library_refuses_what_gaussians_do_not_have():
    scene = gaussians(random_scene())
    of_texture = tensors_of(replace(textured(random_scene()), scales=scene.scales))
    refuses(ArgumentError, "texture: 3D Gaussians have none", bin_surfels, *of_texture, {})
    normal = {"normal": torch.zeros(3, 8, 8)}
    refuses(ArgumentError, "normal: 3D Gaussians have none", bin_surfels, *tensors_of(scene), normal)
    five = tensors_of(scene, scales=torch.rand(N, 5))
    message = "surfels: expected 2 scales of surfels or 3 of"
    refuses(ArgumentError, message, bin_surfels, *five, {})


def test_library_refuses_what_is_not_of_the_forward_call():
    surfels, view = tensors_of(random_scene())
    images = {"color": torch.empty(surfels.channels, 8, 8), "alpha": torch.empty(8, 8)}
    frame = bin_surfels(surfels, view, images)

    def backward(surfels, **gradients):
        images_and_gradients = (autograd.Image(**images), autograd.Image(**gradients), autograd.Gradients())
        structures = (*view.structures(surfels), *images_and_gradients)
        native.call("texgs_backward", frame.pointer, *structures, device=torch.device("cpu"))

    for name in ("depth", "median", "distortion"):
        message = "a gradient of depth, median or distortion without"
        refuses(ArgumentError, message, backward, surfels, **{name: images["alpha"]})
    fewer = SurfelTensors(*(None if x is None else x[1:] for x in surfels))
    refuses(ArgumentError, "frame: expected as many surfels, scales and channels as", backward, fewer)
    message = "frame: expected an image as large as in the forward call"
    refuses(ArgumentError, message, autograd.contribute, frame, surfels, replace(view, width=9), None)


def test_library_refuses_colours_that_do_not_add_up():
    colored, view = tensors_of(textured_with_features(random_scene(), 2))

    def forward(surfels, channels):
        structures = view.structures(surfels)
        structures[0].channels = channels
        handle = ctypes.byref(ctypes.c_void_p())
        native.call("texgs_forward", *structures, autograd.Image(), handle, device=torch.device("cpu"))

    refuses(ArgumentError, "features: expected C - 3 beside a texture", forward, colored, 3)
    bare = colored._replace(features=None)
    refuses(ArgumentError, "features: expected C - 3 beside a texture", forward, bare, 5)
    refuses(ArgumentError, r"texture: .* are needed, with 3 channels at least", forward, colored, 2)
    bare = bare._replace(base=None, gain=None, texels=None)
    refuses(ArgumentError, "surfels: features or a texture are needed", forward, bare, 2)


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
        refuses(ArgumentError, name, random_scene().render, rasterize, options=Options(**{name: value}))


def test_memory_layout_does_not_matter(device, drawn):
    scene = drawn(replace(random_scene(), shift=torch.rand(N, 2))).to(device)
    strided = scene.map(lambda x: x.repeat_interleave(2, 0)[::2] if x.ndim == 1 else x.T.contiguous().T)
    assert not strided.means.is_contiguous()
    expected, result = (images(s.render(rasterize, scene.outputs)) for s in (scene, strided))
    cotangents = random_cotangents(scene, names_of(scene))
    expected |= gradients(rasterize, scene, cotangents)
    result |= gradients(rasterize, strided, cotangents)
    for name, value in expected.items():
        assert torch.equal(result[name], value), name
    half = torch.tensor(0.5, device=device)
    expanded, dense = (replace(scene, opacities=x) for x in (half.expand(N), half.repeat(N)))
    assert torch.equal(expanded.render(rasterize).color, dense.render(rasterize).color)


def test_inputs_are_left_alone(device):
    scene = textured(random_scene()).to(device)
    copy = scene.map(torch.clone)
    gradients(rasterize, scene, random_cotangents(scene, ("color", "depth")))
    for name, leaf in scene.leaves().items():
        assert torch.equal(leaf, copy.leaves()[name])


def test_camera_changed_before_backward():
    scene = random_scene()
    scene = replace(scene, viewmat=scene.viewmat.clone(), means=scene.means.clone().requires_grad_())
    color = scene.render(rasterize).color
    scene.viewmat[0, 3] += 0.1
    refuses(RuntimeError, "modified by an inplace operation", color.sum().backward)


def test_infinitely_far_plane(device):
    scene, far = random_scene().to(device), Options(far=float("inf"))
    expected = scene.render(rasterize, ("distortion",), Options(far=1e9)).distortion
    torch.testing.assert_close(scene.render(rasterize, ("distortion",), far).distortion, expected)
