"""What planes leave of a camera's rays: where each begins and ends, and the face at which it begins."""

from typing import NamedTuple

import torch
from torch import Tensor
from torch.nn.functional import normalize

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.raster import native
from texgs.raster.arguments import pinhole, require
from texgs.raster.autograd import Camera as NativeCamera

MOST_PLANES = 12

native.declare("texgs_cut_range", NativeCamera, "ippp")


class CutRange(NamedTuple):
    """The rays of a view behind the planes of a cut."""

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
    if count > MOST_PLANES:
        raise ArgumentError(f"normals: expected {MOST_PLANES} planes at most, got {count}; leave some out")
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
