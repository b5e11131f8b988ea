"""Volume rendering by VTK's fixed-point ray caster, without OpenGL: another program to compare with.

VTK casts the rays into a 15-bit RGBA image of its own, and only to show that image does it need OpenGL. Here
the image is taken as it is: no driver, no display, no loss to 8 bits. Lights and viewer are distant: the
directions to them are the same for all points of one view (OpenGL's light model without local viewer).

Its numbers have 15 bits: opacities of samples and colours are rounded to 1/32767, which tells where things
are very transparent and steps short. Rays end at an opacity of 0.992, and too early where they are almost
parallel to a side of the volume. Intensities are interpolated between the samples of the grid, not gradients.
"""

from __future__ import annotations

import ctypes
import re
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from vtkmodules import vtkRenderingVolumeOpenGL2  # noqa: F401, registers what the mapper creates
from vtkmodules.vtkCommonDataModel import vtkPlane
from vtkmodules.vtkRenderingCore import vtkLight, vtkRenderer, vtkVolume
from vtkmodules.vtkRenderingOpenGL2 import vtkGenericOpenGLRenderWindow
from vtkmodules.vtkRenderingVolume import vtkFixedPointVolumeRayCastMapper

from texgs.core.camera import Camera
from texgs.core.light import Light
from texgs.volume.grid import Grid
from texgs.volume.render import Appearance
from texgs.volume.transfer import TransferFunction
from texgs.volume.vtk_renderer import aim, image_data, point_light, volume_property

FULL = 32767  # 1.0 in the mapper's fixed-point numbers
MARGIN = 2  # pixels; the mapper may leave out the last row and column of a view that the volume fills


class VtkCaster:
    """Renders one volume from any camera; samples of more than 8 bits are not copied."""

    def __init__(self, grid: Grid, appearance: Appearance, threads: int) -> None:
        image, self._factor = image_data(grid)
        self._appearance = appearance
        self._mapper = vtkFixedPointVolumeRayCastMapper()
        self._mapper.SetInputData(image)
        self._mapper.SetAutoAdjustSampleDistances(0)
        self._mapper.SetImageSampleDistance(1)
        self._mapper.SetSampleDistance(appearance.step * min(image.GetSpacing()))
        self._mapper.SetNumberOfThreads(threads)
        self._volume = vtkVolume()
        self._volume.SetMapper(self._mapper)
        self._light = vtkLight()
        self._light.SetAmbientColor(1, 1, 1)
        self._renderer = vtkRenderer()
        self._renderer.AddLight(self._light)
        self._renderer.AddVolume(self._volume)
        # Never shown: the renderer takes its size from a window.
        self._window = vtkGenericOpenGLRenderWindow()
        self._window.AddRenderer(self._renderer)

    def cut(self, normals: Sequence[Sequence[float]], offsets: Sequence[float]) -> None:
        """Leave what lies behind planes: where normal . x <= offset, for unit normals."""
        self._mapper.RemoveAllClippingPlanes()
        for normal, offset in zip(np.array(normals), offsets, strict=True):
            plane = vtkPlane()
            plane.SetNormal(*-normal)  # VTK keeps what is in front
            plane.SetOrigin(*(normal * offset))
            self._mapper.AddClippingPlane(plane)

    def render(self, tf: TransferFunction, camera: Camera, light: Light) -> NDArray[np.float32]:
        """Return premultiplied RGBA [H, W, 4] in [0, 1], from a transfer function in data values."""
        around = camera.crop(-MARGIN, -MARGIN, camera.width + MARGIN, camera.height + MARGIN)
        return self._cast(tf, around, light)[MARGIN:-MARGIN, MARGIN:-MARGIN]

    def _cast(self, tf: TransferFunction, camera: Camera, light: Light) -> NDArray[np.float32]:
        """Return what VTK's rays see."""
        self._volume.SetProperty(volume_property(tf, self._appearance, self._factor))
        self._window.SetSize(camera.width, camera.height)
        aim(self._renderer.GetActiveCamera(), camera)
        point_light(self._light, camera, light)
        self._renderer.ResetCameraClippingRange()
        mapper, renderer, volume = self._mapper, self._renderer, self._volume
        picture = np.zeros((camera.height, camera.width, 4), np.float32)
        mapper.Update()
        if not mapper.PerImageInitialization(renderer, volume, 0, [0.0, 0.0], [0.0, 0.0], [0, 0]):
            return picture  # the volume is out of sight
        mapper.PerVolumeInitialization(renderer, volume)
        mapper.PerSubVolumeInitialization(renderer, volume, 0)
        mapper.RenderSubVolume()
        pixels, x, y = self._pixels()
        height, width = pixels.shape[:2]
        picture[y : y + height, x : x + width] = pixels
        return picture[::-1] / np.float32(FULL)

    def _pixels(self) -> tuple[NDArray[np.uint16], int, int]:
        """Return the mapper's image [h, w, 4], lowest row first, and where its first pixel is in the view."""
        image = self._mapper.GetRayCastImage()
        address = re.match(r"_([0-9a-fA-F]+)_p_", str(image.GetImage()))
        assert address is not None, f"expected a pointer, got {image.GetImage()!r}"
        memory_width, memory_height = image.GetImageMemorySize()
        width, height = image.GetImageInUseSize()
        x, y = image.GetImageOrigin()
        buffer = (ctypes.c_uint16 * (4 * memory_width * memory_height)).from_address(int(address[1], 16))
        pixels = np.ctypeslib.as_array(buffer).reshape(memory_height, memory_width, 4)
        return pixels[:height, :width], x, y
