"""Volume rendering by VTK through PyVista, offscreen by OpenGL: another program to compare with, on request.

Its shading is Phong's, with a viewer nearby: highlights differ from those of `texgs.volume.caster`.
"""

from __future__ import annotations

import os
from copy import copy
from dataclasses import replace
from importlib import import_module
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from texgs.core.camera import Camera
from texgs.core.light import Light
from texgs.volume.appearance import Appearance, image_data, volume_property
from texgs.volume.grid import Grid
from texgs.volume.opengl import offscreen_opengl
from texgs.volume.transfer import TransferFunction
from texgs.volume.vtk_camera import aim, point_light

if TYPE_CHECKING:
    from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLRenderWindow

TABLE = 8192  # entries that resolve the transfer function; VTK doubles it, and drivers have 16384 or more


class VtkMapper:
    """Renders one volume from any camera; arguments as for `Caster`.

    Raises:
        DeviceError: if there is no offscreen OpenGL; found out in a child process, where it may crash.
    """

    local_viewer = True

    def __init__(self, grid: Grid, appearance: Appearance) -> None:
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")  # asks no X server
        self.driver = offscreen_opengl()
        from vtkmodules.vtkRenderingCore import vtkLight, vtkVolume
        from vtkmodules.vtkRenderingVolumeOpenGL2 import vtkOpenGLGPUVolumeRayCastMapper

        pyvista = import_module("pyvista")
        image, self._factor = image_data(grid)
        low, high = image.GetScalarRange()
        self._ramp = (high - low) / self._factor / TABLE
        self._appearance = appearance
        mapper = vtkOpenGLGPUVolumeRayCastMapper()
        mapper.SetInputData(image)
        mapper.SetAutoAdjustSampleDistances(0)
        mapper.SetSampleDistance(appearance.step * min(image.GetSpacing()))
        mapper.SetMaxMemoryInBytes(2**40)  # the driver knows better
        self._volume = vtkVolume()
        self._volume.SetMapper(mapper)
        self._plotter = pyvista.Plotter(off_screen=True, lighting="none")
        self._plotter.set_background("black")  # colour over black is premultiplied colour
        self._plotter.ren_win.SetMultiSamples(0)
        float_buffers(self._plotter.ren_win)
        self._light = vtkLight()
        self._plotter.renderer.AddLight(self._light)
        self._plotter.renderer.AddVolume(self._volume)

    def looking(self, appearance: Appearance) -> VtkMapper:
        """The same volume and window with another shading; `step` stays."""
        other = copy(self)
        other._appearance = replace(appearance, step=self._appearance.step)
        return other

    def render(self, tf: TransferFunction, camera: Camera, light: Light) -> NDArray[np.float32]:
        """Premultiplied RGBA [H, W, 4] in [0, 1], from a transfer function in data values."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkFloatArray

        self._volume.SetProperty(volume_property(tf, self._appearance, self._factor, self._ramp))
        self._plotter.window_size = [camera.width, camera.height]
        aim(self._plotter.camera, camera)
        point_light(self._light, camera, light)
        self._plotter.renderer.ResetCameraClippingRange()
        self._plotter.ren_win.Render()
        pixels = vtkFloatArray()
        self._plotter.ren_win.GetRGBAPixelData(0, 0, camera.width - 1, camera.height - 1, 0, pixels)
        return vtk_to_numpy(pixels).reshape(camera.height, camera.width, 4)[::-1].copy()


def float_buffers(window: vtkOpenGLRenderWindow) -> None:
    """Let a window blend and store 32-bit floats instead of 8 bits; resizing keeps them."""
    from vtkmodules.vtkCommonCore import VTK_FLOAT
    from vtkmodules.vtkRenderingOpenGL2 import vtkTextureObject

    window.Render()  # creates the buffers
    for buffer in (window.GetRenderFramebuffer(), window.GetDisplayFramebuffer()):
        texture = vtkTextureObject()
        texture.SetContext(window)
        texture.Create2D(*window.GetSize(), 4, VTK_FLOAT, False)
        buffer.SaveCurrentBindingsAndBuffers()
        buffer.Bind()
        buffer.AddColorAttachment(0, texture)
        buffer.RestorePreviousBindingsAndBuffers()
