"""Volume rendering by VTK through PyVista, offscreen by OpenGL: another program to compare with, on request.

Its shading is Phong's, with a viewer nearby: highlights differ from those of `texgs.volume.caster`.
"""

from copy import copy
from dataclasses import replace
from math import atan, degrees
from typing import Any, Self, cast

import numpy as np
import pyvista
from numpy.typing import NDArray
from vtkmodules.util.numpy_support import vtk_to_numpy
from vtkmodules.vtkCommonCore import VTK_FLOAT, vtkFloatArray
from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
from vtkmodules.vtkRenderingCore import vtkCamera, vtkColorTransferFunction, vtkLight, vtkVolume
from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLRenderWindow, vtkTextureObject
from vtkmodules.vtkRenderingVolumeOpenGL2 import vtkOpenGLGPUVolumeRayCastMapper

from texgs.core.camera import Camera
from texgs.core.errors import ArgumentError
from texgs.core.light import Light
from texgs.volume.grid import Grid
from texgs.volume.opengl import offscreen_opengl
from texgs.volume.render import Appearance, directions
from texgs.volume.transfer import TransferFunction

TABLE = 8192  # entries of the transfer function; VTK doubles them, and drivers support at least 16384


class VtkRenderer:
    """Renders one volume from any camera; arguments as for `Caster`."""

    local_viewer = True

    def __init__(self, grid: Grid, appearance: Appearance) -> None:
        offscreen_opengl()
        image, self._factor = image_data(grid)
        low, high = image.GetScalarRange()
        self._ramp = (high - low) / self._factor / TABLE
        self._appearance = appearance
        mapper = vtkOpenGLGPUVolumeRayCastMapper()
        mapper.SetInputData(image)
        mapper.SetAutoAdjustSampleDistances(0)
        mapper.SetSampleDistance(appearance.step * min(image.spacing))
        mapper.SetMaxMemoryInBytes(2**40)  # the driver knows better
        self._volume = vtkVolume()
        self._volume.SetMapper(mapper)
        self._plotter = cast(Any, pyvista.Plotter(off_screen=True, lighting="none"))
        self._plotter.set_background("black")  # colour over black is premultiplied colour
        self._plotter.ren_win.SetMultiSamples(0)
        use_float_buffers(self._plotter.ren_win)
        self._light = vtkLight()
        self._plotter.renderer.AddLight(self._light)
        self._plotter.renderer.AddVolume(self._volume)

    def with_appearance(self, appearance: Appearance) -> Self:
        """Return a renderer of the same volume and window with another shading; `step` stays."""
        other = copy(self)
        other._appearance = replace(appearance, step=self._appearance.step)
        return other

    def render(self, tf: TransferFunction, camera: Camera, light: Light) -> NDArray[np.float32]:
        """Return premultiplied RGBA [H, W, 4] in [0, 1], from a transfer function in data values."""
        self._volume.SetProperty(volume_property(tf, self._appearance, self._factor, self._ramp))
        self._plotter.window_size = [camera.width, camera.height]
        aim(self._plotter.camera, camera)
        point_light(self._light, camera, light)
        self._plotter.renderer.ResetCameraClippingRange()
        self._plotter.ren_win.Render()
        pixels = vtkFloatArray()
        self._plotter.ren_win.GetRGBAPixelData(0, 0, camera.width - 1, camera.height - 1, 0, pixels)
        return vtk_to_numpy(pixels).reshape(camera.height, camera.width, 4)[::-1].copy()


def image_data(grid: Grid) -> tuple[pyvista.ImageData, float]:
    """Return the grid in world units, and the factor by which its values were multiplied.

    Samples are not copied, but for 8 bits: VTK's CPU mapper interpolates in the type of the samples, and 256
    levels would show as bands. They become 16 bits.
    """
    values, factor = np.ascontiguousarray(grid.values), 1.0
    if values.dtype.itemsize == 1:
        factor = 128.0
        values = values.astype(np.int16 if values.dtype.kind == "i" else np.uint16)
        values *= np.asarray(factor, values.dtype)
    spacing = [grid.scale * step for step in grid.spacing]
    image = pyvista.ImageData(dimensions=grid.dims, spacing=spacing, origin=grid.aabb[0])
    image["values"] = values.reshape(-1)
    return image, factor


def volume_property(
    tf: TransferFunction, appearance: Appearance, factor: float, ramp: float | None = None
) -> pyvista.VolumeProperty:
    """Return transfer function, shading and opacity unit for VTK.

    The factor is that of `image_data`, the ramp that of `TransferFunction.without_steps`.
    """
    points = tf.without_steps(ramp)
    opacity, color = vtkPiecewiseFunction(), vtkColorTransferFunction()
    for value, alpha in points.opacity:
        opacity.AddPoint(value * factor, alpha)
    for value, *rgb in points.color:
        color.AddRGBPoint(value * factor, *rgb)
    result = pyvista.VolumeProperty(
        interpolation_type="linear",
        shade=True,
        ambient=appearance.ambient,
        diffuse=appearance.diffuse,
        specular=appearance.specular,
        specular_power=appearance.shininess,
        opacity_unit_distance=appearance.opacity_unit,
    )
    result.SetScalarOpacity(opacity)
    result.SetColor(color)
    return result


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


def point_light(target: vtkLight, camera: Camera, light: Light) -> None:
    """Let a VTK light shine from the direction of a `Light`."""
    target.SetLightTypeToSceneLight()
    target.SetFocalPoint(0, 0, 0)
    target.SetPosition(*directions(camera, light)[1])


def use_float_buffers(window: vtkOpenGLRenderWindow) -> None:
    """Let a window blend and store 32-bit floats instead of 8 bits; resizing keeps them."""
    window.Render()  # creates the buffers
    for buffer in (window.GetRenderFramebuffer(), window.GetDisplayFramebuffer()):
        texture = vtkTextureObject()
        texture.SetContext(window)
        texture.Create2D(*window.GetSize(), 4, VTK_FLOAT, False)
        buffer.SaveCurrentBindingsAndBuffers()
        buffer.Bind()
        buffer.AddColorAttachment(0, texture)
        buffer.RestorePreviousBindingsAndBuffers()
