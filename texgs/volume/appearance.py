"""How a volume looks besides its transfer function, and the same as objects of VTK."""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import TYPE_CHECKING

import numpy as np

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction

if TYPE_CHECKING:
    from vtkmodules.vtkCommonDataModel import vtkImageData
    from vtkmodules.vtkRenderingCore import vtkVolumeProperty


@dataclass(frozen=True)
class Appearance:
    """Blinn-Phong factors and sampling of a volume rendering.

    Raises:
        ArgumentError: if a factor is negative, or a length is not above 0.
    """

    ambient: float = 0.3
    diffuse: float = 0.7
    specular: float = 0.3
    shininess: float = 20.0
    step: float = 0.25  # sample distance, voxels of the finest axis
    opacity_unit: float = 0.005  # length over which a transfer function's opacity applies, world units

    def __post_init__(self) -> None:
        for name in ("ambient", "diffuse", "specular", "shininess"):
            if not 0 <= getattr(self, name) < inf:
                raise ArgumentError(f"{name}: expected at least 0, got {getattr(self, name)}")
        for name in ("step", "opacity_unit"):
            if not 0 < getattr(self, name) < inf:
                raise ArgumentError(f"{name}: expected more than 0, got {getattr(self, name)}")


def image_data(grid: Grid) -> tuple[vtkImageData, float]:
    """The grid in world units, and the factor by which its values were multiplied.

    Samples are not copied, but for 8 bits: VTK's CPU mapper interpolates in the type of the samples, and 256
    levels would show as bands. They become 16 bits.
    """
    from vtkmodules.util.numpy_support import numpy_to_vtk
    from vtkmodules.vtkCommonDataModel import vtkImageData

    values = np.ascontiguousarray(grid.values)
    factor = 1.0
    if values.dtype.itemsize == 1:
        factor = 128.0
        values = values.astype(np.int16 if values.dtype.kind == "i" else np.uint16)
        values *= np.asarray(factor, values.dtype)
    image = vtkImageData()
    image.SetDimensions(*grid.dims)
    image.SetSpacing(*(grid.scale * step for step in grid.spacing))
    image.SetOrigin(*grid.aabb[0])
    scalars = numpy_to_vtk(values.reshape(-1), deep=False)  # keeps the array alive
    image.GetPointData().SetScalars(scalars)
    return image, factor


def volume_property(
    tf: TransferFunction, appearance: Appearance, factor: float, ramp: float | None = None
) -> vtkVolumeProperty:
    """Transfer function, shading and opacity unit for VTK.

    Args:
        tf: in data values.
        appearance: the rest.
        factor: of `image_data`.
        ramp: of `TransferFunction.without_steps`.
    """
    from vtkmodules.vtkCommonDataModel import vtkPiecewiseFunction
    from vtkmodules.vtkRenderingCore import vtkColorTransferFunction, vtkVolumeProperty

    points = tf.without_steps(ramp)
    opacity, color = vtkPiecewiseFunction(), vtkColorTransferFunction()
    for value, alpha in points.opacity:
        opacity.AddPoint(value * factor, alpha)
    for value, *rgb in points.color:
        color.AddRGBPoint(value * factor, *rgb)
    result = vtkVolumeProperty()
    result.SetScalarOpacity(opacity)
    result.SetColor(color)
    result.SetScalarOpacityUnitDistance(appearance.opacity_unit)
    result.SetInterpolationTypeToLinear()
    result.ShadeOn()
    result.SetAmbient(appearance.ambient)
    result.SetDiffuse(appearance.diffuse)
    result.SetSpecular(appearance.specular)
    result.SetSpecularPower(appearance.shininess)
    return result
