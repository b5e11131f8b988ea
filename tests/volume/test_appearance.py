import numpy as np
import pytest

from texgs.core.errors import ArgumentError
from texgs.volume.appearance import Appearance, image_data, volume_property
from texgs.volume.grid import Grid
from texgs.volume.transfer import TransferFunction

pytest.importorskip("vtkmodules")
TF = TransferFunction(((2, 0.5), (4, 0.5), (4, 0.1), (8, 0)), ((2, 1, 0, 0), (6, 0, 1, 0)))


@pytest.mark.parametrize("field", ["ambient", "diffuse", "specular", "shininess"])
@pytest.mark.parametrize("value", [-0.1, float("nan"), float("inf")])
def test_factors_are_checked(field, value):
    with pytest.raises(ArgumentError, match=f"{field}: expected at least 0, got {value}"):
        Appearance(**{field: value})


@pytest.mark.parametrize("field", ["step", "opacity_unit"])
@pytest.mark.parametrize("value", [0, -1, float("nan")])
def test_lengths_are_checked(field, value):
    with pytest.raises(ArgumentError, match=f"{field}: expected more than 0, got {value}"):
        Appearance(**{field: value})


def test_the_image_lies_where_the_grid_does():
    values = np.arange(2 * 3 * 5, dtype=np.float32).reshape(2, 3, 5)
    grid = Grid(values, (1.0, 3.0, 2.0), (7.0, 8.0, 9.0))
    image, factor = image_data(grid)
    assert factor == 1
    assert image.GetDimensions() == (5, 3, 2)
    np.testing.assert_allclose(np.reshape(image.GetBounds(), (3, 2)).T, grid.aabb)
    assert image.GetScalarComponentAsDouble(4, 1, 1, 0) == values[1, 1, 4]
    values[0, 0, 0] = 77  # the samples are not copied
    assert image.GetScalarComponentAsDouble(0, 0, 0, 0) == 77


@pytest.mark.parametrize(("dtype", "wide"), [("uint8", "unsigned short"), ("int8", "short")])
def test_8_bits_become_16_over_the_whole_range(dtype, wide):
    info = np.iinfo(dtype)
    values = np.linspace(info.min, info.max, 27).astype(dtype).reshape(3, 3, 3)
    image, factor = image_data(Grid(values))
    assert image.GetScalarTypeAsString() == wide
    assert image.GetScalarRange() == (info.min * factor, info.max * factor)


@pytest.mark.parametrize("factor", [1.0, 128.0])
@pytest.mark.parametrize("ramp", [None, 0.01])
def test_vtk_has_the_transfer_function(factor, ramp):
    prop = volume_property(TF, Appearance(opacity_unit=0.02, shininess=7), factor, ramp)
    values = np.array([0, 1.9, 2, 3, 3.9, 4, 5, 7, 8, 9])
    opacity = [prop.GetScalarOpacity().GetValue(value * factor) for value in values]
    color = [prop.GetRGBTransferFunction().GetColor(value * factor) for value in values]
    expected = TF(values)
    at_its_start = values != 2  # a step at the first point is a ramp from there
    np.testing.assert_allclose(np.array(opacity)[at_its_start], expected[at_its_start, 3], atol=1e-5)
    np.testing.assert_allclose(color, expected[:, :3], atol=1e-5)
    assert prop.GetScalarOpacityUnitDistance() == 0.02
    assert prop.GetSpecularPower() == 7
    assert prop.GetShade()
