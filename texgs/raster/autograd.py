"""The native rasterizer as a differentiable function of torch, and the arguments of a call."""

from ctypes import byref
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import torch
from torch import Tensor

from texgs.raster import native
from texgs.raster.types import DEFAULT_OPTIONS, Options, Statistics

IMAGES = ("color", "alpha", "depth", "median", "normal", "distortion")
Surfels = native.struct(
    "texgs_surfels",
    "n n, i axes, p means quats scales opacities, i raw, p shift, i channels, "
    "p features base gain texels sizes offsets, n n_texels",
)
Camera = native.struct("texgs_camera", "p viewmat K, i width height, p depth_range")
RenderOptions = native.struct(
    "texgs_options",
    "p background, f low_pass filter_sigma dilation, i antialiased, "
    "f alpha_min transmittance_min near_plane far_plane",
)
Image = native.struct("texgs_image", "p color alpha depth median normal distortion radii")
Gradients = native.struct("texgs_gradients", "p means quats scales opacities shift features base gain texels")
Contributions = native.struct(
    "texgs_contributions", "p image, i channels, p sums weight_sum weight_max pixels"
)
SCENE = (Surfels, Camera, RenderOptions)
native.declare("texgs_forward", *SCENE, Image, "p")
native.declare("texgs_backward", "p", *SCENE, Image, Image, Gradients)
native.declare("texgs_contribute", "p", *SCENE, Contributions)
native.declare("texgs_release", "p", result=None, stream=False)


class SurfelTensors(NamedTuple):
    """All differentiable tensors, in the order of `texgs_gradients`."""

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
class RasterView:
    """All constants of a call: camera, options, texture layout, wanted outputs."""

    viewmat: Tensor  # [4, 4]
    K: Tensor  # [3, 3]
    width: int
    height: int
    outputs: frozenset[str] = frozenset()
    options: Options = DEFAULT_OPTIONS
    background: Tensor | None = None  # [C]
    sizes: Tensor | None = None  # [N, 2] of the texture
    offsets: Tensor | None = None  # [N]
    depth_range: Tensor | None = None  # [2, H, W] camera z
    raw: bool = field(default=False, kw_only=True)  # scales are logarithms and opacities logits

    def images(self, surfels: SurfelTensors) -> dict[str, Tensor]:
        """Allocate the planar images of the wanted outputs."""
        means, size = surfels.means, (self.height, self.width)
        images = {"color": means.new_empty(surfels.channels, *size), "alpha": means.new_empty(size)}
        for name in self.outputs & {"depth", "median", "distortion"}:
            images[name] = means.new_empty(size)
        if "normal" in self.outputs:
            images["normal"] = means.new_empty(3, *size)
        return images

    def structures(self, surfels: SurfelTensors) -> tuple[native.Struct, ...]:
        """Return surfels, camera and options as structures of the library."""
        means, quats, scales, opacities, shift, *colors = surfels
        geometry = (*scales.shape, means, quats, scales, opacities, self.raw, shift)
        n_texels = 0 if surfels.texels is None else len(surfels.texels)
        scene = Surfels(*geometry, surfels.channels, *colors, self.sizes, self.offsets, n_texels)
        o = self.options
        low_pass = min(o.low_pass, 1e30)  # infinite: no filter; the library multiplies it by 0 at the centre
        far = min(o.far, 1e30)  # infinite: far / (far - near) is 1
        filters = (low_pass, o.filter_sigma, o.dilation, o.antialiased)
        options = RenderOptions(self.background, *filters, o.alpha_min, o.transmittance_min, o.near, far)
        return scene, Camera(self.viewmat, self.K, self.width, self.height, self.depth_range), options


def bin_surfels(surfels: SurfelTensors, view: RasterView, images: dict[str, Tensor]) -> native.Handle:
    """Project, sort and bin the surfels, and render into `images` where it has a "color"."""
    device = surfels.means.device
    frame = native.Handle("texgs_release", device)
    scene = view.structures(surfels)
    native.call("texgs_forward", *scene, Image(**images), byref(frame.pointer), device=device)
    return frame


def contribute(
    frame: native.Handle, surfels: SurfelTensors, view: RasterView, image: Tensor | None
) -> tuple[Tensor, Tensor, Tensor, Tensor]:
    """Return sums [N, C] of weight * image [C, H, W]; sum of weights, largest weight, pixels [N]."""
    means = surfels.means
    n, channels = len(means), 0 if image is None else len(image)
    sums = means.new_empty(n, channels)
    weight_sum, weight_max, pixels = means.new_empty(3, n)
    out = Contributions(image, channels, sums, weight_sum, weight_max, pixels)
    native.call("texgs_contribute", frame.pointer, *view.structures(surfels), out, device=means.device)
    return sums, weight_sum, weight_max, pixels


class RasterizeFunction(torch.autograd.Function):
    """Surfel tensors to images; the images are planar, [C, H, W] and [H, W]."""

    @staticmethod
    def forward(ctx: Any, view: RasterView, extra: dict, *tensors: Any) -> tuple[Tensor | None, ...]:
        """Render; `extra` receives the statistics."""
        surfels = SurfelTensors(*tensors)
        means = surfels.means
        radii = {"radii": means.new_empty(len(means))} if "statistics" in view.outputs else {}
        images = view.images(surfels)
        frame = bin_surfels(surfels, view, images | radii)
        if radii:
            _, weight_sum, weight_max, pixels = contribute(frame, surfels, view, None)
            extra["statistics"] = Statistics(weight_sum, weight_max, pixels, radii["radii"])
        ctx.view, ctx.frame = view, frame
        # The view holds them already; saved here too, so that autograd notices changes in place.
        constants = (view.viewmat, view.K, view.background, view.sizes, view.offsets, view.depth_range)
        ctx.save_for_backward(*tensors, *(images.get(name) for name in IMAGES), *constants)
        ctx.set_materialize_grads(False)
        return tuple(images.get(name) for name in IMAGES)

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx: Any, *grads: Tensor | None) -> tuple[Tensor | None, ...]:
        """Return the gradients of the surfel tensors from those of the images."""
        n = len(SurfelTensors._fields)
        surfels, images = SurfelTensors(*ctx.saved_tensors[:n]), ctx.saved_tensors[n : n + len(IMAGES)]
        dense = (None if grad is None else grad.contiguous() for grad in grads)
        results = native.gradients(surfels, ctx.needs_input_grad[2:])
        structures = (*ctx.view.structures(surfels), Image(*images), Image(*dense), Gradients(*results))
        with ctx.frame.lock:
            native.call("texgs_backward", ctx.frame.pointer, *structures, device=surfels.means.device)
        return None, None, *results
