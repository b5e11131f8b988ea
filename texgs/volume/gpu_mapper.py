"""Volume rendering by OpenGL through PyVista, offscreen: fast on a GPU, slow where the driver is software.

VTK's own shading is Phong's, with a viewer nearby, and differs between kinds of light. It is replaced by the
Blinn-Phong model that `texgs.volume.caster` has.
"""

from __future__ import annotations

import os
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
from texgs.volume.vtk_camera import aim, directions

if TYPE_CHECKING:
    from vtkmodules.vtkRenderingCore import vtkUniforms, vtkVolume
    from vtkmodules.vtkRenderingOpenGL2 import vtkOpenGLRenderWindow

TABLE = 8192  # entries that resolve the transfer function; VTK doubles it, and drivers have 16384 or more

# The gradient is in world axes, because the volume is placed by its origin and spacing only.
LIGHTING = """
vec4 computeLighting(vec4 color, int component, float label)
{
  vec3 gradient = computeGradient(g_dataPos, component, in_volume[0], 0).xyz;
  float magnitude = length(gradient);
  vec3 normal = magnitude > 0.0 ? gradient / magnitude : vec3(0.0);
  normal = dot(normal, to_viewer) < 0.0 ? -normal : normal;
  float n_l = max(dot(normal, to_light), 0.0);
  float n_h = max(dot(normal, normalize(to_light + to_viewer)), 0.0);
  float specular = n_l > 0.0 ? k_specular * pow(n_h, shininess) : 0.0;
  return vec4(color.rgb * (k_ambient + k_diffuse * n_l) + specular, color.a);
}
"""


class GpuMapper:
    """Renders one volume from any camera; arguments as for `Caster`.

    Raises:
        DeviceError: if there is no offscreen OpenGL; found out in a child process, where it may crash.
    """

    local_viewer = False

    def __init__(self, grid: Grid, appearance: Appearance) -> None:
        os.environ.setdefault("VTK_DEFAULT_OPENGL_WINDOW", "vtkEGLRenderWindow")  # asks no X server
        self.driver = offscreen_opengl()
        from vtkmodules.vtkRenderingCore import vtkVolume
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
        self._uniforms = replace_lighting(self._volume, appearance)
        self._plotter = pyvista.Plotter(off_screen=True, lighting="none")
        self._plotter.set_background("black")  # colour over black is premultiplied colour
        self._plotter.ren_win.SetMultiSamples(0)
        float_buffers(self._plotter.ren_win)
        self._plotter.renderer.AddVolume(self._volume)

    def render(self, tf: TransferFunction, camera: Camera, light: Light) -> NDArray[np.float32]:
        """Premultiplied RGBA [H, W, 4] in [0, 1], from a transfer function in data values."""
        from vtkmodules.util.numpy_support import vtk_to_numpy
        from vtkmodules.vtkCommonCore import vtkFloatArray

        self._volume.SetProperty(volume_property(tf, self._appearance, self._factor, self._ramp))
        self._plotter.window_size = [camera.width, camera.height]
        aim(self._plotter.camera, camera)
        to_viewer, to_light = directions(camera, light)
        self._uniforms.SetUniform3f("to_viewer", to_viewer.tolist())
        self._uniforms.SetUniform3f("to_light", to_light.tolist())
        self._plotter.renderer.ResetCameraClippingRange()
        self._plotter.ren_win.Render()
        pixels = vtkFloatArray()
        self._plotter.ren_win.GetRGBAPixelData(0, 0, camera.width - 1, camera.height - 1, 0, pixels)
        return vtk_to_numpy(pixels).reshape(camera.height, camera.width, 4)[::-1].copy()


def replace_lighting(volume: vtkVolume, appearance: Appearance) -> vtkUniforms:
    """Let a volume be shaded by our model; returns where to set `to_viewer` and `to_light`."""
    shader = volume.GetShaderProperty()
    shader.AddFragmentShaderReplacement("//VTK::ComputeLighting::Dec", True, LIGHTING, False)
    uniforms = shader.GetFragmentCustomUniforms()
    uniforms.SetUniformf("k_ambient", appearance.ambient)
    uniforms.SetUniformf("k_diffuse", appearance.diffuse)
    uniforms.SetUniformf("k_specular", appearance.specular)
    uniforms.SetUniformf("shininess", appearance.shininess)
    return uniforms


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
