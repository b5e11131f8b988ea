"""Cameras as transforms_*.json has them: OpenGL camera-to-world matrices and one lens for all frames."""

from __future__ import annotations

from collections.abc import Mapping
from math import atan, pi, tan
from typing import Any

import torch
from torch import Tensor

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.names import is_number

LENS_KEYS = ("camera_angle_x", "w", "h", "fl_x", "fl_y", "cx", "cy")
OPENCV_FROM_OPENGL = torch.diag(torch.tensor([1.0, -1.0, -1.0, 1.0], dtype=torch.float64))  # its own inverse
RIGID = 1e-4  # entries of R^T R may differ from the identity by this much


def camera_to_world(viewmat: Tensor) -> Tensor:
    """Camera-to-world matrix [4, 4] with OpenGL axes (y up, z back), float64, of a world-to-camera matrix."""
    return torch.linalg.inv(viewmat.double()) @ OPENCV_FROM_OPENGL.to(viewmat.device)


def world_to_camera(where: str, matrix: Any) -> Tensor:
    """World-to-camera matrix [4, 4] with OpenCV axes, float64, of what a frame has as `transform_matrix`.

    Args:
        where: file and frame, for messages.
        matrix: four rows of four numbers; the last row is taken as 0 0 0 1.
    """
    try:
        rigid = torch.tensor(matrix, dtype=torch.float64)
    except (TypeError, ValueError, RuntimeError) as error:
        raise ArgumentError(f"{where}: transform_matrix: expected four rows of four numbers") from error
    if rigid.shape != (4, 4):
        raise ArgumentError(
            f"{where}: transform_matrix: expected four rows of four numbers, got shape {list(rigid.shape)}"
        )
    rigid[3] = torch.tensor([0.0, 0.0, 0.0, 1.0])
    R_wc = rigid[:3, :3]
    defect = float((R_wc.T @ R_wc - torch.eye(3, dtype=torch.float64)).abs().max())
    # Written so that NaN is refused as well.
    if not (defect < RIGID and bool(rigid.isfinite().all()) and float(torch.linalg.det(R_wc)) > 0):
        raise ArgumentError(
            f"{where}: transform_matrix: expected a rotation and a position, got a matrix that is singular, "
            "scaled, mirrored or not finite"
        )
    return torch.linalg.inv(rigid @ OPENCV_FROM_OPENGL)


def lens_values(camera: Camera) -> dict[str, float]:
    """What the top level of the file says about size (pixels), focal lengths and principal point."""
    K = camera.K.tolist()
    return {
        "camera_angle_x": 2 * atan(0.5 * camera.width / K[0][0]),
        "w": camera.width,
        "h": camera.height,
        "fl_x": K[0][0],
        "fl_y": K[1][1],
        "cx": K[0][2],
        "cy": K[1][2],
    }


def lens_matrix(where: str, values: Mapping[str, Any], width: int, height: int) -> Tensor:
    """K [3, 3], float32, from the top level of the file.

    Focal lengths default to `camera_angle_x` (horizontal, radians) and square pixels, the principal point
    to the middle.
    """
    if "fl_x" in values:
        focal_x = number(where, values, "fl_x")
    else:
        angle = number(where, values, "camera_angle_x")
        if not 0 < angle < pi:
            raise ArgumentError(f"{where}: camera_angle_x: expected radians between 0 and pi, got {angle}")
        focal_x = 0.5 * width / tan(0.5 * angle)
    focal_y = number(where, values, "fl_y", focal_x)
    if not min(focal_x, focal_y) > 0:
        raise ArgumentError(f"{where}: expected focal lengths above 0, got {focal_x} and {focal_y}")
    cx, cy = number(where, values, "cx", 0.5 * width), number(where, values, "cy", 0.5 * height)
    return torch.tensor([[focal_x, 0.0, cx], [0.0, focal_y, cy], [0.0, 0.0, 1.0]])


def number(where: str, values: Mapping[str, Any], key: str, default: float | None = None) -> float:
    """The finite number at `key`."""
    value = values.get(key, default)
    if value is None:
        raise ArgumentError(f"{where}: expected the key {key}, found {', '.join(values) or 'no keys'}")
    if not is_number(value):
        raise ArgumentError(f"{where}: {key}: expected a finite number, got {value!r:.100}")
    return value
