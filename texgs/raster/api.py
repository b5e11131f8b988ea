"""Render surfels, and splat images back onto them."""

from __future__ import annotations

from collections.abc import Collection

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.raster import native
from texgs.raster.autograd import IMAGES, SURFEL_TENSORS, RasterizeFunction, View, bin_surfels, contribute
from texgs.raster.types import DEFAULT_OPTIONS, OUTPUTS, Options, Render, Texture

MAX_CHANNELS = 32
BYTES_PER_SURFEL = 512  # records, footprints, sorting, a few tiles: what no scene stays below


def rasterize(
    means: Tensor,  # [N, 3]
    quats: Tensor,  # [N, 4]
    scales: Tensor,  # [N, 2]
    opacities: Tensor,  # [N]
    viewmat: Tensor,  # [4, 4]
    K: Tensor,  # [3, 3]
    width: int,
    height: int,
    *,
    features: Tensor | None = None,  # [N, C]
    texture: Texture | None = None,
    background: Tensor | None = None,  # [C]
    shift: Tensor | None = None,  # [N, 2]
    outputs: Collection[str] = (),
    options: Options = DEFAULT_OPTIONS,
) -> Render:
    """Composite surfels front to back into one view.

    Differentiable in means, quats, scales, opacities, shift, features and the texture's base, gain and texels; not
    in the camera or the background. Costs less where the geometry (the first four and `shift`) needs no gradient.
    The result is the same, bit for bit, for any number of threads. `texgs.raster.reference.rasterize` is the
    definition; the formulation is that of Huang et al. 2024 (2DGS), section 4.

    Args:
        means: [N, 3] world units.
        quats: [N, 4] wxyz, of any length but zero; the third axis is the normal.
        scales: [N, 2] standard deviations along the first two axes, world units.
        opacities: [N] in [0, 1].
        viewmat: [4, 4] world to camera, OpenCV axes.
        K: [3, 3] intrinsics in pixels, without skew; pixel centres lie at +0.5.
        width: of the image in pixels.
        height: of the image in pixels.
        features: [N, C] one colour per surfel, C from 1 to 32; or else
        texture: a colour that varies over the surfel, C = 3.
        background: [C], black by default.
        shift: [N, 2] pixels added to the whole projection of a surfel. Pass zeros that require a gradient to learn
            how the loss changes as surfels move on screen, as densification needs it.
        outputs: any of "depth", "median", "normal", "distortion", "statistics".
        options: filter, thresholds and depth range.

    Returns:
        Render with color [H, W, C], alpha [H, W], and the outputs asked for. Images are views of planar memory.

    Raises:
        ArgumentError, ShapeError, DeviceError: naming the argument at fault.
        OutOfMemoryError: naming the bytes needed, before they are allocated.
    """
    surfels = _collect(means, quats, scales, opacities, features, texture, shift)
    view = _view(surfels, viewmat, K, width, height, background, texture, frozenset(outputs), options)
    found: dict = {}
    images = RasterizeFunction.apply(view, found, *(surfels[name] for name in SURFEL_TENSORS))
    image = dict(zip(IMAGES, images, strict=True))
    for name in ("color", "normal"):
        if image[name] is not None:
            image[name] = image[name].permute(1, 2, 0)
    return Render(**image, statistics=found.get("statistics"))


def splat(
    image: Tensor,  # [H, W, C]
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    viewmat: Tensor,
    K: Tensor,
    *,
    options: Options = DEFAULT_OPTIONS,
) -> tuple[Tensor, Tensor]:
    """Splat an image back onto the surfels that show it: the adjoint of rendering features over black.

    Divided by the weights, the sums are the average of the image as each surfel sees it: votes of a segmentation,
    labels lifted from pixels to surfels. Not differentiable.

    Args:
        image: [H, W, C], C from 1 to 32.
        means: [N, 3] and the rest as in `rasterize`.
        quats: [N, 4].
        scales: [N, 2].
        opacities: [N].
        viewmat: [4, 4].
        K: [3, 3].
        options: as the image was rendered with.

    Returns:
        Sums [N, C] over all pixels of blending weight times image, and the sums [N] of the weights.
    """
    channels = check.shape("image", image, "H W C")
    check.floating("image", image)
    check.same_device(means=means, image=image)
    if not 1 <= channels["C"] <= MAX_CHANNELS:
        raise ArgumentError(f"image: expected 1 to {MAX_CHANNELS} channels, got {channels['C']}")
    with torch.no_grad():
        surfels = _collect(means, quats, scales, opacities, image.new_empty(len(means), 1), None, None)
        view = _view(surfels, viewmat, K, channels["W"], channels["H"], None, None, frozenset(), options)
        if options.check_finite:
            check.finite(image=image)
        frame = bin_surfels(surfels, view, {})
        sums, weights, _, _ = contribute(frame, surfels, view, image.permute(2, 0, 1).contiguous())
    return sums, weights


def _collect(
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    features: Tensor | None,
    texture: Texture | None,
    shift: Tensor | None,
) -> dict[str, Tensor | None]:
    """All surfel tensors by name, checked and dense."""
    if (features is None) == (texture is None):
        given = "both" if texture is not None else "neither"
        raise ArgumentError(f"rasterize: expected either features or texture, got {given}")
    tensors = {"means": means, "quats": quats, "scales": scales, "opacities": opacities, "shift": shift}
    tensors |= {"features": features, "base": None, "gain": None, "texels": None}
    if texture is not None:
        tensors |= {"base": texture.base, "gain": texture.gain, "texels": texture.texels}
    sizes = check.shape("means", means, "N 3")
    axes = {"quats": "4", "scales": "2", "opacities": "", "shift": "2", "features": "C", "base": "3", "gain": ""}
    for name, last in axes.items():
        if tensors[name] is not None:
            sizes |= check.shape(name, tensors[name], f"N {last}", **sizes)
    if texture is not None:
        _check_texture(texture, sizes["N"])
    elif not 1 <= sizes["C"] <= MAX_CHANNELS:
        raise ArgumentError(f"features: expected 1 to {MAX_CHANNELS} channels, got {sizes['C']}")
    for name, tensor in tensors.items():
        if tensor is not None:
            check.floating(name, tensor)
    device = check.same_device(**tensors)
    native.require_memory(BYTES_PER_SURFEL * sizes["N"], device)
    return {name: None if x is None else x.contiguous() for name, x in tensors.items()}


def _check_texture(texture: Texture, n: int) -> None:
    check.shape("texture.texels", texture.texels, "T 3")
    check.shape("texture.sizes", texture.sizes, "N 2", N=n)
    check.shape("texture.offsets", texture.offsets, "N", N=n)
    for name, dtype in (("sizes", torch.int32), ("offsets", torch.int64)):
        if (found := getattr(texture, name).dtype) != dtype:
            raise ArgumentError(f"texture.{name}: expected {dtype}, got {found}; convert it with .to({dtype})")
    check.same_device(**{f"texture.{name}": getattr(texture, name) for name in ("texels", "sizes", "offsets")})
    if n and texture.sizes.device.type == "cpu":  # elsewhere it would wait for the device
        ends = texture.offsets + texture.sizes.long().prod(1)
        if int(texture.sizes.min()) < 1 or int(texture.offsets.min()) < 0 or int(ends.max()) > len(texture.texels):
            raise ArgumentError(
                f"texture: expected sizes of at least 1 and textures within the {len(texture.texels)} texels, "
                f"got sizes from {int(texture.sizes.min())}, offsets from {int(texture.offsets.min())} "
                f"and a last texel at {int(ends.max()) - 1}"
            )


def _view(
    surfels: dict[str, Tensor | None],
    viewmat: Tensor,
    K: Tensor,
    width: int,
    height: int,
    background: Tensor | None,
    texture: Texture | None,
    outputs: frozenset[str],
    options: Options,
) -> View:
    """The rest of the arguments, checked."""
    means = surfels["means"]
    channels = 3 if surfels["features"] is None else surfels["features"].shape[1]
    check.shape("viewmat", viewmat, "4 4")
    check.shape("K", K, "3 3")
    camera = {"viewmat": viewmat, "K": K}
    if background is not None:
        check.shape("background", background, "C", C=channels)
        camera["background"] = background
    for name, tensor in camera.items():
        check.floating(name, tensor)
    check.same_device(means=means, **camera)
    if K.device.type == "cpu" and K[0, 1] != 0:
        raise ArgumentError(f"K: expected no skew, got K[0, 1] = {float(K[0, 1])}")
    if unknown := sorted(outputs - set(OUTPUTS)):
        raise ArgumentError(f"outputs: expected any of {', '.join(OUTPUTS)}, got {unknown[0]!r}")
    if not (1 <= width < 2**20 and 1 <= height < 2**20):
        raise ArgumentError(f"width, height: expected 1 to {2**20 - 1} pixels, got {width} x {height}")
    if options.check_finite:
        check.finite(**surfels, **camera)
    planes = channels + 3 * len(outputs) + 2
    native.require_memory(4 * planes * width * height, means.device)
    layout = (None, None) if texture is None else (texture.sizes.contiguous(), texture.offsets.contiguous())
    dense = {name: x.detach().contiguous() for name, x in camera.items()}
    return View(
        viewmat=dense["viewmat"],
        K=dense["K"],
        width=width,
        height=height,
        background=dense.get("background"),
        sizes=layout[0],
        offsets=layout[1],
        outputs=outputs,
        options=options,
    )
