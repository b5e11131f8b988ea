"""The native rasterizer as a differentiable function of torch."""

from __future__ import annotations

import ctypes
import weakref
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from texgs.raster import native
from texgs.raster.types import Options, Statistics

# Surfel tensors in the order in which RasterizeFunction takes them and `texgs_gradients` returns them.
SURFEL_TENSORS = ("means", "quats", "scales", "opacities", "shift", "features", "base", "gain", "texels")
IMAGES = ("color", "alpha", "depth", "median", "normal", "distortion")


@dataclass
class View:
    """What does not take part in differentiation: camera, options, texture layout, wanted outputs."""

    viewmat: Tensor
    K: Tensor
    width: int
    height: int
    background: Tensor | None
    sizes: Tensor | None
    offsets: Tensor | None
    outputs: frozenset[str]
    options: Options

    def structures(self, surfels: dict[str, Tensor | None]) -> tuple[Any, Any, Any]:
        """Surfels, camera and options as the library takes them."""
        o = self.options
        features, texels = surfels["features"], surfels["texels"]
        pointers = {name: native.address(x) for name, x in surfels.items()}
        scene = native.Surfels(
            n=len(surfels["means"]),
            channels=3 if features is None else features.shape[1],
            sizes=native.address(self.sizes),
            offsets=native.address(self.offsets),
            n_texels=0 if texels is None else len(texels),
            **pointers,
        )
        camera = native.Camera(
            viewmat=native.address(self.viewmat), K=native.address(self.K), width=self.width, height=self.height
        )
        options = native.RenderOptions(
            native.address(self.background),
            min(o.low_pass, 1e30),  # infinite: no filter; the library multiplies it by 0 at the centre
            o.filter_sigma,
            o.alpha_min,
            o.transmittance_min,
            o.near,
            o.far,
        )
        return scene, camera, options


class Frame:
    """Owns one view's sorted and binned surfels in the library until nothing needs them."""

    def __init__(self, handle: int | None, device: torch.device) -> None:
        self.handle = handle
        weakref.finalize(self, native.library(device.type).texgs_release, handle)


def bin_surfels(surfels: dict[str, Tensor | None], view: View, images: dict[str, Tensor]) -> Frame:
    """Project, sort and bin the surfels, and render into `images` where it has a "color"."""
    device = surfels["means"].device
    handle = ctypes.c_void_p()
    image = native.Image(**{name: native.address(x) for name, x in images.items()})
    native.call("texgs_forward", *view.structures(surfels), image, ctypes.byref(handle), device=device)
    return Frame(handle.value, device)


def contribute(frame: Frame, surfels: dict[str, Tensor | None], view: View, image: Tensor | None) -> tuple:
    """Sums [N, C] of weight * image [C, H, W], sum of weights, largest weight and number of pixels [N]."""
    means = surfels["means"]
    n, channels = len(means), 0 if image is None else len(image)
    sums = means.new_empty(n, channels)
    weight_sum, weight_max, pixels = means.new_empty(3, n)
    out = native.Contributions(
        native.address(image), channels, *(native.address(x) for x in (sums, weight_sum, weight_max, pixels))
    )
    native.call("texgs_contribute", frame.handle, *view.structures(surfels), out, device=means.device)
    return sums, weight_sum, weight_max, pixels


class RasterizeFunction(torch.autograd.Function):
    """Surfel tensors to images; the images are planar, [C, H, W] and [H, W]."""

    @staticmethod
    def forward(ctx: Any, view: View, found: dict, *tensors: Tensor | None) -> tuple[Tensor | None, ...]:
        surfels = dict(zip(SURFEL_TENSORS, tensors, strict=True))
        means, features = surfels["means"], surfels["features"]
        channels = 3 if features is None else features.shape[1]
        size = (view.height, view.width)
        images = {"color": means.new_empty(channels, *size), "alpha": means.new_empty(size)}
        for name in view.outputs & {"depth", "median", "distortion"}:
            images[name] = means.new_empty(size)
        if "normal" in view.outputs:
            images["normal"] = means.new_empty(3, *size)
        radii = {"radii": means.new_empty(len(means))} if "statistics" in view.outputs else {}
        frame = bin_surfels(surfels, view, images | radii)
        if radii:
            found["statistics"] = Statistics(*contribute(frame, surfels, view, None)[1:], radii["radii"])
        ctx.view, ctx.frame = view, frame
        ctx.save_for_backward(*tensors, *(images.get(name) for name in IMAGES))
        ctx.set_materialize_grads(False)
        return tuple(images.get(name) for name in IMAGES)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *grads: Tensor | None) -> tuple[Tensor | None, ...]:
        saved = ctx.saved_tensors
        surfels = dict(zip(SURFEL_TENSORS, saved, strict=False))
        images = dict(zip(IMAGES, saved[len(SURFEL_TENSORS) :], strict=True))
        wanted = dict(zip(SURFEL_TENSORS, ctx.needs_input_grad[2:], strict=True))
        results = {name: torch.empty_like(surfels[name]) for name, needed in wanted.items() if needed}
        dense = {name: None if g is None else g.contiguous() for name, g in zip(IMAGES, grads, strict=True)}
        native.call(
            "texgs_backward",
            ctx.frame.handle,
            *ctx.view.structures(surfels),
            native.Image(**{name: native.address(x) for name, x in images.items()}),
            native.Image(**{name: native.address(x) for name, x in dense.items()}),
            native.Gradients(**{name: native.address(x) for name, x in results.items()}),
            device=surfels["means"].device,
        )
        return None, None, *(results.get(name) for name in SURFEL_TENSORS)
