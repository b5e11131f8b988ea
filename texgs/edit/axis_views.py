"""Six views along the axes: front, back, left, right, top and bottom, chosen by direction or made."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from math import acos, atan, cos, degrees, radians

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera, orbit
from texgs.core.errors import ArgumentError

# Direction from the object to the camera; the front is +z, as for the paths of cameras.
AXES = {
    "front": (0.0, 0.0, 1.0),
    "back": (0.0, 0.0, -1.0),
    "left": (-1.0, 0.0, 0.0),
    "right": (1.0, 0.0, 0.0),
    "top": (0.0, 1.0, 0.0),
    "bottom": (0.0, -1.0, 0.0),
}
ANGLES = {"front": (-90, 0), "back": (90, 0), "left": (180, 0), "right": (0, 0), "top": (-90, 90)} | {
    "bottom": (-90, -90)
}  # azimuth and polar in degrees
FARTHEST = 45.0  # degrees from its axis: beyond, another axis is nearer
BORDER = 1.06  # of the field of view against what holds the scene, for surfels have an extent
NEAREST = 0.05  # distance to the nearest point against that to the middle


def choose_axis_views(cameras: Sequence[Camera], center: Tensor | None = None) -> dict[str, int]:
    """For each axis the camera that sees the object most nearly along it (the paper's section Text-Driven).

    Indices depend on the order of views and their number; directions do not.

    Args:
        cameras: of which six are chosen, all different.
        center: [3] of the object, world units; the origin by default.

    Returns:
        Index by name, in the order of `AXES`.

    Raises:
        ArgumentError: if an axis has no camera within 45 degrees that is not taken by another.
    """
    found: dict[str, int] = {}
    middle = torch.zeros(3) if center is None else center
    check.shape("center", middle, "3")
    toward = [camera.position.double().cpu() - middle.double().cpu() for camera in cameras]
    for name, axis in AXES.items():
        cosines = {
            index: float(x @ x.new_tensor(axis) / x.norm().clamp_min(1e-12))
            for index, x in enumerate(toward)
            if index not in found.values()
        }
        best = max(cosines, key=cosines.__getitem__, default=None)
        if best is None or cosines[best] < cos(radians(FARTHEST)):
            nearest = "none" if best is None else f"one at {degrees(acos(max(-1.0, cosines[best]))):.0f}"
            raise ArgumentError(
                f"cameras: expected one within {FARTHEST:g} degrees of the {name} view, got {nearest}; "
                "make views with axis_cameras"
            )
        found[name] = best
    return found


def axis_cameras(
    like: Camera, points: Tensor, width: int | None = None, height: int | None = None
) -> dict[str, Camera]:
    """Six new cameras exactly along the axes of a scene, which it fills.

    They look at the middle of the scene from as far as another camera does, with the narrowest field of view
    that shows all of it in all six: a guidance works best on a large object, and pixels become texels.

    Args:
        like: its distance from the middle of the scene is taken over.
        points: [N, 3] of the scene, world units, such as means of surfels; at least one.
        width: pixels; as `like` by default.
        height: pixels; as `like` by default.

    Returns:
        Camera by name, in the order of `AXES`, on the device of `like`.

    Raises:
        ArgumentError: if `like` is too near to see the scene from there.
    """
    check.shape("points", points, "N 3")
    points = points.detach().cpu().double()
    low, high = points.amin(dim=0), points.amax(dim=0)
    center = 0.5 * (low + high)
    radius = float((like.position.cpu().double() - center).norm())
    size = (like.width if width is None else width, like.height if height is None else height)
    tangent = _widest(points - center, radius, size[0] / size[1])
    fov = degrees(2 * atan(BORDER * tangent))
    cameras = {}
    for name, (azimuth, polar) in ANGLES.items():
        camera = orbit(azimuth, polar, radius, fov, *size)
        viewmat = camera.viewmat.clone()
        viewmat[:3, 3] -= viewmat[:3, :3] @ center.to(viewmat)
        cameras[name] = replace(camera, viewmat=viewmat).to(like.viewmat.device)
    return cameras


def _widest(points: Tensor, radius: float, aspect: float) -> float:
    """Tangent of half the vertical field of view that holds points [N, 3] around the origin in six views."""
    widest = 1e-3
    for azimuth, polar in ANGLES.values():
        R_cw = orbit(azimuth, polar, radius, FARTHEST, 2, 2).viewmat[:3, :3].to(points)
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
