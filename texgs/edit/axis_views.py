"""Six views along the axes: front, back, left, right, top and bottom."""

from __future__ import annotations

from dataclasses import replace
from math import atan, degrees

from torch import Tensor

from texgs.core import check
from texgs.core.camera import Camera, orbit
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
        Camera by name, in the order of `ANGLES`, on the device of `like`.

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
