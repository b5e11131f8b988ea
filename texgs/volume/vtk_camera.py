"""Cameras and lights of texgs for VTK."""

from __future__ import annotations

from math import atan, degrees
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import Light

if TYPE_CHECKING:
    from vtkmodules.vtkRenderingCore import vtkCamera, vtkLight


def aim(target: vtkCamera, camera: Camera) -> None:
    """Give a VTK camera the place, direction and lens of a `Camera`."""
    K, viewmat = camera.K.double().cpu().numpy(), camera.viewmat.double().cpu().numpy()
    centre = (0.5 * camera.width, 0.5 * camera.height)
    if not np.allclose(K[0, 0], K[1, 1], rtol=1e-5) or not np.allclose(K[:2, 2], centre, atol=1e-3):
        raise ArgumentError(
            f"K: expected square pixels and the principal point {centre}, got focal lengths {K[0, 0]:g}, "
            f"{K[1, 1]:g} and {K[0, 2]:g}, {K[1, 2]:g}; volumes are rendered with such cameras only"
        )
    position = -viewmat[:3, :3].T @ viewmat[:3, 3]
    target.SetPosition(*position)
    target.SetFocalPoint(*(position + viewmat[2, :3]))
    target.SetViewUp(*-viewmat[1, :3])
    target.SetViewAngle(degrees(2 * atan(0.5 * camera.height / K[1, 1])))


def directions(camera: Camera, light: Light) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Unit vectors to the viewer and to the light, [3] each: both are distant, the same for all points.

    A headlight shines along the optical axis.
    """
    to_viewer = -camera.viewmat.double().cpu().numpy()[2, :3]
    return to_viewer, to_viewer if light.kind == "headlight" else light.direction(camera).numpy()


def point_light(target: vtkLight, camera: Camera, light: Light) -> None:
    """Let a VTK light shine from the direction of a `Light`."""
    target.SetLightTypeToSceneLight()
    target.SetFocalPoint(0, 0, 0)
    target.SetPosition(*directions(camera, light)[1])
