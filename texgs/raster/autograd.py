"""The native rasterizer as a differentiable function of torch, and what one call of it works on."""

from __future__ import annotations

import ctypes
import weakref
from ctypes import Structure, c_float, c_int32, c_int64, c_void_p
from dataclasses import dataclass
from typing import Any, NamedTuple

import torch
from torch import Tensor

from texgs.raster import native
from texgs.raster.types import Options, Statistics

IMAGES = ("color", "alpha", "depth", "median", "normal", "distortion")


def _fields(pointers: str, **numbers: type) -> list[tuple[str, type]]:
    return [(name, c_void_p) for name in pointers.split()] + list(numbers.items())


class Surfels(Structure):
    """`texgs_surfels`."""

    _fields_ = [
        ("n", c_int64),
        ("axes", c_int32),
        *_fields("means quats scales opacities shift", channels=c_int32),
        *_fields("features base gain texels sizes offsets", n_texels=c_int64),
    ]


class Camera(Structure):
    """`texgs_camera`."""

    _fields_ = _fields("viewmat K", width=c_int32, height=c_int32)


class RenderOptions(Structure):
    """`texgs_options`."""

    _fields_ = [
        ("background", c_void_p),
        *((name, c_float) for name in ("low_pass", "filter_sigma", "dilation")),
        ("antialiased", c_int32),
        *((name, c_float) for name in ("alpha_min", "transmittance_min", "near_plane", "far_plane")),
    ]


class Image(Structure):
    """`texgs_image`."""

    _fields_ = _fields("color alpha depth median normal distortion radii")


class Gradients(Structure):
    """`texgs_gradients`."""

    _fields_ = _fields("means quats scales opacities shift features base gain texels")


class Contributions(Structure):
    """`texgs_contributions`."""

    _fields_ = [("image", c_void_p), ("channels", c_int32), *_fields("sums weight_sum weight_max pixels")]


SCENE = (Surfels, Camera, RenderOptions)
native.declare("texgs_forward", *SCENE, Image, "p")
native.declare("texgs_backward", "p", *SCENE, Image, Image, Gradients)
native.declare("texgs_contribute", "p", *SCENE, Contributions)
native.declare("texgs_release", "p", result=None, stream=False)


class SurfelTensors(NamedTuple):
    """Everything that gradients are computed for, in the order of `texgs_gradients`."""

    means: Tensor  # [N, 3]
    quats: Tensor  # [N, 4]
    scales: Tensor  # [N, 2] of surfels, [N, 3] of 3D Gaussians
    opacities: Tensor  # [N]
    shift: Tensor | None = None  # [N, 2]
    features: Tensor | None = None  # [N, C], or [N, C - 3] beside a texture:
    base: Tensor | None = None  # [N, 3]
    gain: Tensor | None = None  # [N]
    texels: Tensor | None = None  # [T, 3]

    @property
    def channels(self) -> int:
        """Channels C of the colour: those of the texture, then those of the features."""
        plain = 0 if self.features is None else self.features.shape[1]
        return plain if self.base is None else 3 + plain


@dataclass(frozen=True)
class View:
    """What does not take part in differentiation: camera, options, texture layout, wanted outputs."""

    viewmat: Tensor  # [4, 4]
    K: Tensor  # [3, 3]
    width: int
    height: int
    background: Tensor | None  # [C]
    sizes: Tensor | None  # [N, 2] of the texture
    offsets: Tensor | None  # [N]
    outputs: frozenset[str]
    options: Options

    def structures(self, surfels: SurfelTensors) -> tuple[Surfels, Camera, RenderOptions]:
        """Return the surfels, camera and options as the library takes them."""
        o = self.options
        scene = Surfels(
            n=len(surfels.means),
            axes=surfels.scales.shape[1],
            channels=surfels.channels,
            sizes=native.address(self.sizes),
            offsets=native.address(self.offsets),
            n_texels=0 if surfels.texels is None else len(surfels.texels),
            **{name: native.address(x) for name, x in surfels._asdict().items()},
        )
        camera = Camera(native.address(self.viewmat), native.address(self.K), self.width, self.height)
        options = RenderOptions(
            native.address(self.background),
            min(o.low_pass, 1e30),  # infinite: no filter; the library multiplies it by 0 at the centre
            o.filter_sigma,
            o.dilation,
            o.antialiased,
            o.alpha_min,
            o.transmittance_min,
            o.near,
            min(o.far, 1e30),  # infinite: far / (far - near) is 1
        )
        return scene, camera, options


class Frame:
    """Owns one view's sorted and binned surfels in the library until nothing needs them."""

    def __init__(self, handle: int | None, device: torch.device) -> None:
        self.handle = handle
        weakref.finalize(self, native.function(native.library(device.type), "texgs_release"), handle)


def bin_surfels(surfels: SurfelTensors, view: View, images: dict[str, Tensor]) -> Frame:
    """Project, sort and bin the surfels, and render into `images` where it has a "color"."""
    device = surfels.means.device
    handle = ctypes.c_void_p()
    image = Image(**{name: native.address(x) for name, x in images.items()})
    native.call("texgs_forward", *view.structures(surfels), image, ctypes.addressof(handle), device=device)
    return Frame(handle.value, device)


def contribute(
    frame: Frame, surfels: SurfelTensors, view: View, image: Tensor | None
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Sums [N, C] of weight * image [C, H, W], sum of weights, largest weight and number of pixels [N]."""
    means = surfels.means
    n, channels = len(means), 0 if image is None else len(image)
    sums = means.new_empty(n, channels)
    weight_sum, weight_max, pixels = means.new_empty(3, n)
    out = Contributions(*native.plain((image, channels, sums, weight_sum, weight_max, pixels)))
    native.call("texgs_contribute", frame.handle, *view.structures(surfels), out, device=means.device)
    return sums, weight_sum, weight_max, pixels


class RasterizeFunction(torch.autograd.Function):
    """Surfel tensors to images; the images are planar, [C, H, W] and [H, W]."""

    @staticmethod
    def forward(ctx: Any, view: View, extra: dict, *tensors: Any) -> tuple[Tensor | None, ...]:
        """Render; `extra` receives the statistics."""
        surfels = SurfelTensors(*tensors)
        means = surfels.means
        size = (view.height, view.width)
        images = {"color": means.new_empty(surfels.channels, *size), "alpha": means.new_empty(size)}
        for name in view.outputs & {"depth", "median", "distortion"}:
            images[name] = means.new_empty(size)
        if "normal" in view.outputs:
            images["normal"] = means.new_empty(3, *size)
        radii = {"radii": means.new_empty(len(means))} if "statistics" in view.outputs else {}
        frame = bin_surfels(surfels, view, images | radii)
        if radii:
            _, weight_sum, weight_max, pixels = contribute(frame, surfels, view, None)
            extra["statistics"] = Statistics(weight_sum, weight_max, pixels, radii["radii"])
        ctx.view, ctx.frame = view, frame
        # The view has them already; saved here too, autograd refuses a backward pass after they were changed.
        constants = (view.viewmat, view.K, view.background, view.sizes, view.offsets)
        ctx.save_for_backward(*tensors, *(images.get(name) for name in IMAGES), *constants)
        ctx.set_materialize_grads(False)
        return tuple(images.get(name) for name in IMAGES)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *grads: Tensor | None) -> tuple[Tensor | None, ...]:
        """Return the gradients of the surfel tensors from those of the images."""
        saved = ctx.saved_tensors
        names = SurfelTensors._fields
        surfels = SurfelTensors(*saved[: len(names)])
        images = dict(zip(IMAGES, saved[len(names) : len(names) + len(IMAGES)], strict=True))
        wanted = zip(names, surfels, ctx.needs_input_grad[2:], strict=True)
        results = {name: torch.empty_like(x) for name, x, needed in wanted if needed and x is not None}
        dense = {name: None if g is None else g.contiguous() for name, g in zip(IMAGES, grads, strict=True)}
        native.call(
            "texgs_backward",
            ctx.frame.handle,
            *ctx.view.structures(surfels),
            Image(**{name: native.address(x) for name, x in images.items()}),
            Image(**{name: native.address(x) for name, x in dense.items()}),
            Gradients(**{name: native.address(x) for name, x in results.items()}),
            device=surfels.means.device,
        )
        return None, None, *(results.get(name) for name in names)
