"""Wrong arguments give one clear sentence; unusual but right ones work."""

import ctypes
from dataclasses import replace

import pytest
import torch

from tests.raster.agreement import gradients, images, names_of, random_cotangents
from tests.raster.requirements import refuses
from tests.raster.scenes import gaussians, random_scene, textured, textured_with_features
from texgs.core.errors import ArgumentError, DeviceError, ShapeError, TexgsError
from texgs.raster import autograd, native
from texgs.raster.api import rasterize, splat
from texgs.raster.autograd import SurfelTensors, View
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
def test_a_colour_is_needed(render):
    with pytest.raises(ArgumentError, match="expected features, a texture or both, got neither"):
        replace(random_scene(), features=None).render(render)


@pytest.mark.parametrize("channels", [0, 30])
def test_wrong_number_of_features_beside_a_texture(channels):
    with pytest.raises(ArgumentError, match=f"features: expected 1 to 29 channels, got {channels}"):
        textured_with_features(random_scene(), channels).render(rasterize)


def test_background_of_a_texture_with_features():
    scene = textured_with_features(random_scene(), 2)
    with pytest.raises(ShapeError, match=r"background: expected \[5\], got \[3\]"):
        replace(scene, background=torch.rand(3)).render(rasterize)


@pytest.mark.parametrize("render", [rasterize, reference])
def test_what_gaussians_do_not_have(render):
    scene = gaussians(random_scene())
    with pytest.raises(
        ArgumentError, match=r"texture: expected features for 3D Gaussians .* to draw surfels"
    ):
        replace(textured(random_scene()), scales=scene.scales).render(render)
    with pytest.raises(ArgumentError, match=r"outputs: 3D Gaussians .* have no normal; leave it out"):
        scene.render(render, ("depth", "normal"))


@pytest.mark.parametrize("render", [rasterize, reference])
@pytest.mark.parametrize("columns", [1, 4])
def test_scales_of_nothing(render, columns):
    scene = replace(random_scene(), scales=torch.rand(N, columns))
    expected = r"scales: expected \[N, 2\] or \[N, 3\], got \[200, .*; 2 draw surfels, 3 draw 3D Gaussians"
    refuses(ShapeError, expected, scene.render, render)
    with pytest.raises(
        ShapeError, match=r"scales: expected \[200, 2\|3\], got \[3, 200\]; did you transpose"
    ):
        replace(scene, scales=torch.rand(3, N)).render(rasterize)


def test_library_refuses_what_gaussians_do_not_have():
    scene = gaussians(random_scene())
    view = View(scene.viewmat, scene.K, 8, 8)
    geometry = (scene.means, scene.quats, scene.scales, scene.opacities)
    handle = ctypes.c_void_p()

    def forward(surfels, **images):
        image = autograd.Image(**images)
        native.call(
            "texgs_forward",
            *view.structures(surfels),
            image,
            ctypes.byref(handle),
            device=torch.device("cpu"),
        )

    texture = textured(random_scene()).texture
    with pytest.raises(ArgumentError, match="texture: 3D Gaussians have none"):
        forward(SurfelTensors(*geometry, base=texture.base, gain=texture.gain, texels=texture.texels))
    with pytest.raises(ArgumentError, match="normal: 3D Gaussians have none"):
        forward(SurfelTensors(*geometry, features=scene.features), normal=torch.zeros(3, 8, 8))
    five = SurfelTensors(*geometry, features=scene.features)._replace(scales=torch.rand(N, 5))
    refuses(ArgumentError, "surfels: expected 2 scales of surfels or 3 of 3D Gaussians", forward, five)


def test_library_refuses_what_is_not_of_the_forward_call():
    scene = random_scene()
    view = View(scene.viewmat, scene.K, 8, 8)
    surfels = SurfelTensors(scene.means, scene.quats, scene.scales, scene.opacities, features=scene.features)
    color, alpha = torch.empty(scene.features.shape[1], 8, 8), torch.empty(8, 8)
    image = autograd.Image(color=color, alpha=alpha)
    handle = ctypes.c_void_p()

    def call(name, *arguments, of=surfels, view=view):
        native.call(name, handle, *view.structures(of), *arguments, device=torch.device("cpu"))

    native.call(
        *("texgs_forward", *view.structures(surfels), image, ctypes.byref(handle)), device=torch.device("cpu")
    )
    for name in ("depth", "median", "distortion"):
        with pytest.raises(ArgumentError, match="a gradient of depth, median or distortion without"):
            call("texgs_backward", image, autograd.Image(**{name: alpha}), autograd.Gradients())
    fewer = SurfelTensors(*(None if x is None else x[1:] for x in surfels))
    with pytest.raises(ArgumentError, match="frame: expected as many surfels, scales and channels as"):
        call("texgs_backward", image, autograd.Image(), autograd.Gradients(), of=fewer)
    with pytest.raises(ArgumentError, match="frame: expected an image as large as in the forward call"):
        call("texgs_contribute", autograd.Contributions(), view=replace(view, width=9))
    native.function(native.library(), "texgs_release")(handle)


def test_library_refuses_colours_that_do_not_add_up():
    scene = textured_with_features(random_scene(), 2)
    texture = scene.texture
    tensors = SurfelTensors(scene.means, scene.quats, scene.scales, scene.opacities, features=scene.features)
    colored = tensors._replace(base=texture.base, gain=texture.gain, texels=texture.texels)
    view = View(scene.viewmat, scene.K, 8, 8, sizes=texture.sizes, offsets=texture.offsets)

    def forward(surfels, channels):
        structures = view.structures(surfels)
        structures[0].channels = channels
        handle = ctypes.byref(ctypes.c_void_p())
        native.call("texgs_forward", *structures, autograd.Image(), handle, device=torch.device("cpu"))

    refuses(ArgumentError, "features: expected C - 3 beside a texture", forward, colored, 3)
    with pytest.raises(ArgumentError, match="features: expected C - 3 beside a texture"):
        forward(colored._replace(features=None), 5)
    refuses(ArgumentError, r"texture: .* are needed, with 3 channels at least", forward, colored, 2)
    with pytest.raises(ArgumentError, match="surfels: features or a texture are needed"):
        forward(tensors._replace(features=None), 2)


def test_wrong_device():
    scene = random_scene()
    with pytest.raises(DeviceError, match="features: expected device cpu"):
        replace(scene, features=scene.features.to("meta")).render(rasterize)
    refuses(DeviceError, "cpu or cuda, got meta", scene.to("meta").render, rasterize)


@pytest.mark.parametrize("size", [(0, 5), (5, -1), (2**31, 5), (2**20 - 15, 1), (1, 2**20 - 15)])
def test_wrong_size(size):
    with pytest.raises(ArgumentError, match="width, height: expected 1 to"):
        replace(random_scene(), width=size[0], height=size[1]).render(rasterize)


@pytest.mark.parametrize("channels", [0, 33])
def test_wrong_number_of_channels(channels):
    with pytest.raises(ArgumentError, match=f"1 to 32 channels, got {channels}"):
        random_scene(channels=channels).render(rasterize)
    scene = random_scene()
    geometry = {
        name: getattr(scene, name) for name in ("means", "quats", "scales", "opacities", "viewmat", "K")
    }
    with pytest.raises(ArgumentError, match=f"1 to 32 channels, got {channels}"):
        splat(torch.zeros(5, 5, channels), **geometry)


def test_unknown_output():
    refuses(ArgumentError, "'depths'", random_scene().render, rasterize, ("depths",))


@pytest.mark.parametrize(
    "wrong",
    [
        {"alpha_min": -0.1},
        {"alpha_min": 1e-38},
        {"alpha_min": 1.5},
        {"transmittance_min": 1.0},
        {"transmittance_min": -1e-3},
        {"low_pass": 0.0},
        {"low_pass": float("nan")},
        {"filter_sigma": -1.0},
        {"dilation": 0.0},
        {"dilation": -0.3},
        {"dilation": float("nan")},
        {"near": 0.0},
        {"near": -1.0},
        {"near": 5.0, "far": 2.0},
    ],
    ids=str,
)
def test_wrong_options(wrong):
    refuses(ArgumentError, next(iter(wrong)), random_scene().render, rasterize, options=Options(**wrong))


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


def test_expanded_gradients_and_tensors(device):
    scene = random_scene().to(device)
    expanded = replace(scene, opacities=torch.tensor(0.5, device=device).expand(N))
    dense = replace(scene, opacities=torch.full((N,), 0.5, device=device))
    assert torch.equal(expanded.render(rasterize).color, dense.render(rasterize).color)


def test_inputs_are_left_alone(device):
    scene = textured(random_scene()).to(device)
    copy = scene.map(torch.clone)
    gradients(rasterize, scene, random_cotangents(scene, ("color", "depth")))
    for name, leaf in scene.leaves().items():
        assert torch.equal(leaf, copy.leaves()[name])


@pytest.mark.parametrize("name", ["viewmat", "K"])
def test_transposed_matrix(name):
    scene = random_scene()
    with pytest.raises(ArgumentError, match=rf"{name}\[.*did you transpose\?"):
        replace(scene, **{name: getattr(scene, name).T}).render(rasterize)


@pytest.mark.parametrize(("axis", "focal"), [(0, 0.0), (0, -10.0), (1, -1.0)])
def test_a_focal_length_that_is_none(axis, focal):
    scene = random_scene()
    K = scene.K.clone()
    K[axis, axis] = focal
    with pytest.raises(ArgumentError, match=rf"K: expected focal lengths above 0, got .*= {focal}"):
        replace(scene, K=K).render(rasterize)


def test_camera_changed_before_backward():
    scene = random_scene()
    scene = replace(scene, viewmat=scene.viewmat.clone(), means=scene.means.clone().requires_grad_())
    color = scene.render(rasterize).color
    scene.viewmat[0, 3] += 0.1
    refuses(RuntimeError, "modified by an inplace operation", color.sum().backward)


def test_outputs_as_a_string_and_fractional_sizes():
    with pytest.raises(ArgumentError, match=r"outputs: .* got a string; pass \('depth',\)"):
        random_scene().render(rasterize, "depth")
    with pytest.raises(ArgumentError, match=r"width, height: expected whole numbers, got 5\.0"):
        replace(random_scene(), width=5.0).render(rasterize)


def test_infinitely_far_plane(device):
    scene, far = random_scene().to(device), Options(far=float("inf"))
    expected = scene.render(rasterize, ("distortion",), Options(far=1e9)).distortion
    torch.testing.assert_close(scene.render(rasterize, ("distortion",), far).distortion, expected)
