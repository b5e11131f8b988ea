"""Render surfels or 3D Gaussians, splat images back onto them, and clip the rays of a view by cuts."""

from collections.abc import Collection
from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core import check
from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.raster import arguments, native
from texgs.raster.arguments import pinhole, require
from texgs.raster.autograd import IMAGES, RasterizeFunction, bin_surfels, contribute
from texgs.raster.autograd import Camera as NativeCamera
from texgs.raster.types import DEFAULT_OPTIONS, Options, Render, Texture

MAX_PLANES = 12


def rasterize(
    means: Tensor,  # [N, 3]
    quats: Tensor,  # [N, 4]
    scales: Tensor,  # [N, 2 or 3]
    opacities: Tensor,  # [N]
    viewmat: Tensor,  # [4, 4]
    K: Tensor,  # [3, 3]
    width: int,
    height: int,
    *,
    features: Tensor | None = None,  # [N, F]
    texture: Texture | None = None,
    background: Tensor | None = None,  # [C]
    shift: Tensor | None = None,  # [N, 2]
    depth_range: Tensor | None = None,  # [2, H, W]
    outputs: Collection[str] = (),
    options: Options = DEFAULT_OPTIONS,
) -> Render:
    """Composite surfels, or 3D Gaussians, front to back into one view.

    Two scales make a surfel: flat, textured if wanted, met by the ray of each pixel (Huang et al. 2024, 2DGS,
    section 4). Three make a 3D Gaussian: an ellipse on screen with the depth of its mean (Kerbl et al. 2023,
    3DGS, section 4), without texture and normal.

    Differentiable in means, quats, scales, opacities, shift, features and the texture's base, gain and
    texels; not in the camera or the background, which are refused where they require a gradient. Costs less
    where the geometry (the first four and `shift`) needs none. The result is the same, bit for bit, for any
    number of threads. `texgs.raster.reference.rasterize` is the definition.

    Args:
        means: [N, 3] world units.
        quats: [N, 4] wxyz, of any length but zero; the third axis is the normal.
        scales: [N, 2] standard deviations along the first two axes, or [N, 3] along all three, world units.
        opacities: [N] in [0, 1].
        viewmat: [4, 4] world to camera, OpenCV axes.
        K: [3, 3] intrinsics in pixels, without skew; pixel centres lie at +0.5.
        width: of the image in pixels, 1 to 2^20 - 16.
        height: of the image in pixels, likewise.
        features: [N, F] one colour per surfel or Gaussian.
        texture: a colour that varies over the surfel. With both, the colour has the three channels of the
            texture and then those of the features: C = 3 + F, 32 at most.
        background: [C], black by default.
        shift: [N, 2] pixels added to the whole projection of a surfel or Gaussian. Pass zeros that require a
            gradient to learn how the loss changes as they move on screen, as densification needs it.
        depth_range: [2, H, W] camera z: fragments count from the first on and before the second, as of a cut.
        outputs: any of "depth", "median", "normal", "distortion", "statistics".
        options: filters, thresholds, near and far.

    Returns:
        Render with color [H, W, C], alpha [H, W], and the outputs asked for. Images are views of planar
        memory.
    """
    surfels = arguments.surfel_tensors((means, quats, scales, opacities), shift, features, texture)
    camera = (viewmat, K, background, depth_range)
    view = arguments.view(surfels, camera, (width, height), texture, outputs, options)
    extra: dict = {}
    images = RasterizeFunction.apply(view, extra, *surfels)
    image = dict(zip(IMAGES, images, strict=True))
    for name in ("color", "normal"):
        if image[name] is not None:
            image[name] = image[name].permute(1, 2, 0)
    return Render(**image, statistics=extra.get("statistics"))


def splat(
    image: Tensor,  # [H, W, C]
    means: Tensor,
    quats: Tensor,
    scales: Tensor,
    opacities: Tensor,
    viewmat: Tensor,
    K: Tensor,
    *,
    depth_range: Tensor | None = None,
    options: Options = DEFAULT_OPTIONS,
) -> tuple[Tensor, Tensor]:
    """Splat an image back onto the primitives that show it: the adjoint of rendering features over black.

    Divided by the weights, the sums are the average of the image as each surfel sees it: votes of a
    segmentation, labels lifted from pixels to surfels. Not differentiable.

    Args:
        image: [H, W, C], C from 1 to 32.
        means: [N, 3]; this, quats, scales, opacities, viewmat and K are as in `rasterize`.
        quats: [N, 4].
        scales: [N, 2 or 3].
        opacities: [N].
        viewmat: [4, 4].
        K: [3, 3].
        depth_range: [2, H, W].
        options: as the image was rendered with.

    Returns:
        Sums [N, C] over all pixels of blending weight times image, and the sums [N] of the weights.
    """
    size = arguments.require({"image": (image, "H W C"), "means": (means, "N 3")})
    arguments.channels("image", size["C"])
    if options.check_finite:
        check.finite(image=image)
    geometry = (means, quats, scales, opacities)
    with torch.no_grad():
        surfels = arguments.surfel_tensors(geometry, None, image.new_zeros(size["N"], 1), None)
        camera = (viewmat, K, None, depth_range)
        view = arguments.view(surfels, camera, (size["W"], size["H"]), None, (), options)
        frame = bin_surfels(surfels, view, {})
        sums, weights, _, _ = contribute(frame, surfels, view, image.permute(2, 0, 1).contiguous())
    return sums, weights


native.declare("texgs_cut_range", NativeCamera, "ippp")


class CutRange(NamedTuple):
    """The parts of a view's rays behind the planes of a cut."""

    depth_range: Tensor  # [2, H, W] camera z, 0 and infinity without a plane; no ray: the second is not above
    face: Tensor  # [H, W] int32: the plane through which a ray enters, -1 where it enters through none
    normals: Tensor  # [P, 3] of the planes, unit


def cut_range(normals: Tensor, offsets: Tensor, camera: Camera) -> CutRange:
    """Find the part of each ray of a camera that lies behind all planes: where normal . x <= offset.

    There are 12 normals [P, 3] at most, outward, of any length but zero; offsets [P] are in these lengths and
    world units. Not differentiable. `texgs.raster.reference.render` is the definition.
    """
    matrices = {"viewmat": (camera.viewmat, "4 4"), "K": (camera.K, "3 3")}
    inputs = {"normals": (normals, "P 3"), "offsets": (offsets, "P"), **matrices}
    count = require(inputs, constant=inputs)["P"]
    pinhole(camera.viewmat, camera.K)
    if count > MAX_PLANES:
        raise ArgumentError(f"normals: expected {MAX_PLANES} planes at most, got {count}; leave some out")
    lengths = normals.norm(dim=1)
    if not bool(((lengths > 0) & lengths.isfinite()).all()):
        raise ArgumentError(f"normals: expected finite vectors but 0, got {normals.tolist()}")
    height, width, device = camera.height, camera.width, normals.device
    depth_range = normals.new_empty(2, height, width)
    face = torch.empty(height, width, dtype=torch.int32, device=device)
    view = NativeCamera(camera.viewmat.contiguous(), camera.K.contiguous(), width, height)
    planes = torch.cat([normals, offsets[:, None]], dim=1)
    native.call("texgs_cut_range", view, count, planes, depth_range, face, device=device)
    return CutRange(depth_range, face, normalize(normals, dim=1))
