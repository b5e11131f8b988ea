"""Six views along the axes: front, back, left, right, top and bottom; new ones, or those nearest to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import atan, degrees

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera, orbit, orbit_direction
from texgs.core.errors import ArgumentError

ANGLES = {  # azimuth and polar of the camera in degrees; the front is +z, as for the paths of cameras
    "front": (-90, 0),
    "back": (90, 0),
    "left": (180, 0),
    "right": (0, 0),
    "top": (-90, 90),
    "bottom": (-90, -90),
}
ANY_FOV = 45.0  # degrees, of cameras that only their directions are needed of
BORDER = 1.06  # of the field of view against what holds the scene, for surfels have an extent
NEAREST = 0.05  # distance to the nearest point against that to the middle


def axis_cameras(like: Camera, points: Tensor) -> dict[str, Camera]:
    """Six new cameras exactly along the axes of a scene, which it fills.

    They look at the middle of the scene from as far as another camera does, with the narrowest field of view
    that shows all of it in all six: a guidance works best on a large object, and pixels become texels.

    The scene is points [N, 3], such as means of surfels. Cameras are in the order of `ANGLES`.
    """
    center = _center(points)
    radius = float((like.position.cpu().double() - center).norm())
    tangent = _widest(points.detach().cpu().double() - center, radius, like.width / like.height)
    fov = degrees(2 * atan(BORDER * tangent))
    cameras = {}
    for name, (azimuth, polar) in ANGLES.items():
        camera = orbit(azimuth, polar, radius, fov, like.width, like.height)
        viewmat = camera.viewmat.clone()
        viewmat[:3, 3] -= viewmat[:3, :3] @ center.to(viewmat)
        cameras[name] = replace(camera, viewmat=viewmat).to(like.viewmat.device)
    return cameras


def nearest_to_axes(cameras: Sequence[Camera], points: Tensor) -> dict[str, Camera]:
    """Choose the six different cameras whose directions from a scene are nearest to its axes.

    The sum of the cosines of the angles between cameras and axes is largest. The middle of the scene is that
    of the box around points [N, 3].
    """
    from scipy.optimize import linear_sum_assignment

    if len(cameras) < len(ANGLES):
        raise ArgumentError(
            f"cameras: expected {len(ANGLES)} at least to choose those nearest to the axes from, got "
            f"{len(cameras)}; edit new views along the axes instead (edit.text.views=axes)"
        )
    directions = torch.stack([camera.position.cpu().double() for camera in cameras]) - _center(points)
    axes = torch.stack([orbit_direction(*angles) for angles in ANGLES.values()])  # [6, 3]
    cosines = axes @ torch.nn.functional.normalize(directions, dim=1).T  # [6, V]
    _, chosen = linear_sum_assignment(cosines.numpy(), maximize=True)
    return {name: cameras[index] for name, index in zip(ANGLES, chosen.tolist(), strict=True)}


def _center(points: Tensor) -> Tensor:
    """Middle of the box around points [N, 3], float64 on the CPU."""
    check.shape("points", points, "N 3")
    points = points.detach().cpu().double()
    return 0.5 * (points.amin(dim=0) + points.amax(dim=0))


def _widest(points: Tensor, radius: float, aspect: float) -> float:
    """Tangent of half the vertical field of view that holds points [N, 3] around the origin in six views."""
    widest = 1e-3
    for azimuth, polar in ANGLES.values():
        R_cw = orbit(azimuth, polar, radius, ANY_FOV, 2, 2).viewmat[:3, :3].to(points)
        x, y, z = (points @ R_cw.T).unbind(dim=1)
        if float(z.min()) + radius < NEAREST * radius:
            raise ArgumentError(
                f"like: expected a camera well outside of the scene, got one {radius:.3g} from its middle, "
                "which is too near; pass one farther away"
            )
        widest = max(
            widest, float((y.abs() / (z + radius)).max()), float((x.abs() / (z + radius)).max()) / aspect
        )
    return widest
