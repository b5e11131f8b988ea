"""The native rasterizer as a differentiable function of torch."""

from __future__ import annotations

import ctypes
import weakref
from typing import Any

import torch
from torch import Tensor

from texgs.raster import native
from texgs.raster.inputs import SurfelTensors, View
from texgs.raster.types import Statistics

IMAGES = ("color", "alpha", "depth", "median", "normal", "distortion")


class Frame:
    """Owns one view's sorted and binned surfels in the library until nothing needs them."""

    def __init__(self, handle: int | None, device: torch.device) -> None:
        self.handle = handle
        weakref.finalize(self, native.library(device.type).texgs_release, handle)


def bin_surfels(surfels: SurfelTensors, view: View, images: dict[str, Tensor]) -> Frame:
    """Project, sort and bin the surfels, and render into `images` where it has a "color"."""
    device = surfels.means.device
    handle = ctypes.c_void_p()
    image = native.Image(**{name: native.address(x) for name, x in images.items()})
    native.call("texgs_forward", *view.structures(surfels), image, ctypes.byref(handle), device=device)
    return Frame(handle.value, device)


def contribute(
    frame: Frame, surfels: SurfelTensors, view: View, image: Tensor | None
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Sums [N, C] of weight * image [C, H, W], sum of weights, largest weight and number of pixels [N]."""
    means = surfels.means
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
        """Gradients of the surfel tensors from those of the images."""
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
            native.Image(**{name: native.address(x) for name, x in images.items()}),
            native.Image(**{name: native.address(x) for name, x in dense.items()}),
            native.Gradients(**{name: native.address(x) for name, x in results.items()}),
            device=surfels.means.device,
        )
        return None, None, *(results.get(name) for name in names)
