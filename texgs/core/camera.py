"""Pinhole cameras: OpenCV axes (x right, y down, z forward), world +y up, pixel centres at +0.5."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, isfinite, radians, sin, tan
from numbers import Integral
from typing import Self

import torch
from torch import Tensor

from texgs.core import check
from texgs.core.errors import ArgumentError
from texgs.core.names import require_numbers


@dataclass(frozen=True, eq=False)
class Camera:
    """One view: where the camera is and how it maps points to pixels."""

    viewmat: Tensor  # [4, 4] world to camera
    K: Tensor  # [3, 3] focal lengths and principal point, pixels
    width: int  # pixels
    height: int  # pixels

    def __post_init__(self) -> None:
        for name, size in (("width", self.width), ("height", self.height)):
            if not isinstance(size, Integral):
                raise ArgumentError(f"{name}: expected a whole number of pixels, got {size}")
            if size < 1:
                raise ArgumentError(f"{name}: expected at least 1 pixel, got {size}")
        check.shape("viewmat", self.viewmat, "4 4")
        check.shape("K", self.K, "3 3")

    @property
    def position(self) -> Tensor:
        """Return the camera centre in the world, [3]."""
        R_cw, t_cw = self.viewmat[:3, :3], self.viewmat[:3, 3]
        return -R_cw.T @ t_cw

    def rays(self) -> Tensor:
        """Return world directions [H, W, 3] through the pixel centres, of length 1 along the view axis."""
        return self._rays_in_camera() @ self.viewmat[:3, :3]

    def ray_lengths(self) -> Tensor:
        """Return the lengths [H, W] of `rays`."""
        K = self.K
        right = (torch.arange(self.width, device=K.device) + 0.5 - K[0, 2]) / K[0, 0]
        down = (torch.arange(self.height, device=K.device) + 0.5 - K[1, 2]) / K[1, 1]
        return (1 + right.square() + down.square()[:, None]).sqrt()

    def project(self, points: Tensor) -> tuple[Tensor, Tensor]:
        """Return pixels [..., 2] and camera z [...] of world points [..., 3]; undefined behind the camera."""
        viewmat, K = self.viewmat.to(points), self.K.to(points)
        x, y, z = (points @ viewmat[:3, :3].T + viewmat[:3, 3]).unbind(-1)
        return torch.stack([K[0, 0] * x / z + K[0, 2], K[1, 1] * y / z + K[1, 2]], dim=-1), z

    def unproject(self, depth: Tensor) -> Tensor:
        """Return the world points [H, W, 3] that the pixel centres see at camera z [H, W], world units."""
        check.shape("depth", depth, "H W", H=self.height, W=self.width)
        R_cw, t_cw = self.viewmat[:3, :3], self.viewmat[:3, 3]
        return (self._rays_in_camera() * depth[..., None] - t_cw) @ R_cw

    def _rays_in_camera(self) -> Tensor:
        """Return directions [H, W, 3] through the pixel centres in the camera's axes, z = 1."""
        K = self.K
        sides = (torch.arange(side, device=K.device) for side in (self.height, self.width))
        y, x = torch.meshgrid(*sides, indexing="ij")
        right, down = (x + 0.5 - K[0, 2]) / K[0, 0], (y + 0.5 - K[1, 2]) / K[1, 1]
        return torch.stack([right, down, torch.ones_like(right)], dim=-1)

    def to(self, device: torch.device | str) -> Self:
        """Return the same camera with its matrices on another device."""
        viewmat, K = self.viewmat.to(device), self.K.to(device)
        return self if viewmat is self.viewmat and K is self.K else replace(self, viewmat=viewmat, K=K)

    def crop(self, left: int, top: int, right: int, bottom: int) -> Self:
        """Return the camera of the crop left <= x < right, top <= y < bottom."""
        K = self.K - self.K.new_tensor([[0, 0, left], [0, 0, top], [0, 0, 0]])
        return type(self)(self.viewmat, K, right - left, bottom - top)

    def resized(self, longer: int) -> Self:
        """Return the camera of the same view with another length of the longer side, in pixels."""
        scale = longer / max(self.width, self.height)
        width, height = (max(1, round(side * scale)) for side in (self.width, self.height))
        K = self.K.clone()
        K[0] *= width / self.width
        K[1] *= height / self.height
        return replace(self, K=K, width=width, height=height)


def look_at(position: Tensor, target: Tensor, up: Tensor | None = None) -> Tensor:
    """Return the viewmat [4, 4] of a camera at `position` [3] that looks at `target` [3].

    Differentiable in both; dtype and device are those of `position`. The direction `up` [3], by default the
    world's +y, points up in the image.
    """
    for name, vector in (("position", position), ("target", target)):
        check.shape(name, vector, "3")
    up = position.new_tensor([0.0, 1.0, 0.0]) if up is None else up
    check.shape("up", up, "3")
    view = target - position
    distance = float(view.detach().norm())
    if not isfinite(distance) or distance == 0:
        raise ArgumentError(
            f"look_at: expected position and target to differ and be finite, got a distance of {distance}"
        )
    forward = view / view.norm()
    right = torch.linalg.cross(forward, up)
    sine = float(right.detach().norm() / up.norm())
    if not sine > 1e-6:
        raise ArgumentError("look_at: expected a view that is not along up, got parallel; pass another `up`")
    right = right / right.norm()
    R_cw = torch.stack([right, torch.linalg.cross(forward, right), forward])  # [3, 3], rows are the axes
    last_row = position.new_tensor([[0.0, 0.0, 0.0, 1.0]])
    return torch.cat([torch.cat([R_cw, (-R_cw @ position)[:, None]], dim=1), last_row])


def intrinsics(fov_y: float, width: int, height: int) -> Tensor:
    """Return K [3, 3], float32, of square pixels around the principal point; `fov_y` is vertical, degrees."""
    if not 0 < fov_y < 180:
        raise ArgumentError(f"fov_y: expected degrees between 0 and 180, got {fov_y}")
    focal = 0.5 * height / tan(radians(0.5 * fov_y))
    rows = [[focal, 0.0, 0.5 * width], [0.0, focal, 0.5 * height], [0.0, 0.0, 1.0]]
    return torch.tensor(rows, dtype=torch.float32)  # sizes may be NumPy's


def orbit_direction(azimuth: float, polar: float) -> Tensor:
    """Return the unit vector [3], float64, that points to (azimuth, polar) in degrees.

    Cameras and lights share it: (cos az cos pol, sin pol, -sin az cos pol), so azimuth 0 is +x, -90 is +z
    and polar 90 is straight up.
    """
    a, p = radians(azimuth), radians(polar)
    return torch.tensor([cos(a) * cos(p), sin(p), -sin(a) * cos(p)], dtype=torch.float64)


def orbit(
    azimuth: float,
    polar: float,
    radius: float,
    fov_y: float,
    width: int,
    height: int,
    target: Sequence[float] = (0.0, 0.0, 0.0),
) -> Camera:
    """Return the camera on a sphere around a target [3] that looks at the target; float32.

    Angles are in degrees: for azimuth and polar see `orbit_direction`, the field of view is vertical. The
    poles are allowed.
    """
    require_numbers(azimuth=azimuth, polar=polar, radius=radius)
    if not isfinite(azimuth):
        raise ArgumentError(f"azimuth: expected degrees, got {azimuth}")
    if not abs(polar) <= 90:
        raise ArgumentError(f"polar: expected degrees from -90 to 90, got {polar}")
    if not radius > 0:
        raise ArgumentError(f"radius: expected more than 0, got {radius}")
    a, p = radians(azimuth), radians(polar)
    # The tangent towards growing polar angle: the projected +y where that exists, and defined at the poles.
    up = torch.tensor([-cos(a) * sin(p), cos(p), sin(a) * sin(p)], dtype=torch.float64)
    require_numbers(**dict(zip(("target.x", "target.y", "target.z"), target, strict=False)))
    middle = torch.tensor(tuple(target), dtype=torch.float64)
    check.shape("target", middle, "3")
    viewmat = look_at(middle + radius * orbit_direction(azimuth, polar), middle, up)
    return Camera(viewmat.float(), intrinsics(fov_y, width, height), width, height)
