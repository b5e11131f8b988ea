"""Cells, rectilinear grids and files in pieces, as VTK writes them."""

import numpy as np
import pytest
import pyvista
from vtkmodules.vtkIOParallelXML import vtkXMLPImageDataWriter

from tests.volume.volume_files import SPACING, assert_holds, image_data, sample_values, write_image
from texgs.core.errors import ArgumentError
from texgs.volume.sources import open_source

pytestmark = pytest.mark.subprocess
VALUES = sample_values()
PLACES = [10 + step * np.arange(size) for step, size in zip(SPACING, VALUES.shape[::-1], strict=True)]


def cells(image):
    """An image whose cells hold the values, and which has points around them."""
    image.cell_data["density"] = VALUES.ravel()
    return image


def test_samples_of_cells_lie_in_their_middles(tmp_path):
    image = cells(pyvista.ImageData(dimensions=(14, 13, 12), spacing=SPACING, origin=(10, 20, 30)))
    middle = (10.25, 21, 31.5)
    for name in ("v.vti", "v.vtk"):
        image.save(tmp_path / name)
        assert_holds(tmp_path / name, VALUES, SPACING, middle)
    image.direction_matrix = [[0, 0, -1], [1, 0, 0], [0, 1, 0]]  # x is along y, y along z, z against x
    image.save(tmp_path / "v.vti")
    turned = VALUES.transpose(1, 2, 0)[:, :, ::-1]
    first = 10 - (10.5 * SPACING[2])  # the last cell of z, against x
    assert_holds(tmp_path / "v.vti", turned, (3, 0.5, 2), (first, 20.25, 31))
    grid = cells(pyvista.RectilinearGrid(*(np.append(each, each[-1] + each[1] - each[0]) for each in PLACES)))
    grid.save(tmp_path / "v.vtr")
    assert_holds(tmp_path / "v.vtr", VALUES, SPACING, (10.25, 11, 11.5))


def test_points_come_before_cells_and_vectors_are_no_field(tmp_path):
    image = cells(pyvista.ImageData(dimensions=(14, 13, 12)))
    points = np.arange(14 * 13 * 12.0)
    image.point_data["velocity"] = np.stack([points] * 3, axis=1)
    image.point_data["p"], image.point_data["q"] = points, -points
    image.point_data.active_vectors_name = "velocity"
    image.save(tmp_path / "v.vti")
    note = "array p; dataset.volume.variable chooses another (q, density)"
    assert open_source(tmp_path / "v.vti").note == note
    for keys, values in (({}, points), ({"variable": "q"}, -points)):
        assert_holds(tmp_path / "v.vti", values.reshape(12, 13, 14), **keys)
    assert_holds(tmp_path / "v.vti", VALUES, variable="density")
    with pytest.raises(ArgumentError, match="variable: expected one of p, q, density, got velocity"):
        open_source(tmp_path / "v.vti", variable="velocity")


@pytest.mark.parametrize("name", ["v.vtr", "v.vtk"])
def test_a_rectilinear_grid_has_to_be_even(tmp_path, name):
    grid = pyvista.RectilinearGrid(*PLACES)
    grid["density"] = VALUES.ravel()
    grid.save(tmp_path / name)
    assert_holds(tmp_path / name, VALUES, SPACING, (10, 10, 10))
    grid.y = PLACES[1] ** 2
    grid.save(tmp_path / name)
    with pytest.raises(ArgumentError, match="expected even distances along y; resample it to an image"):
        open_source(tmp_path / name)


def write_pieces(path):
    """Write an image in three pieces."""
    write_image(path, image_data(VALUES), vtkXMLPImageDataWriter, NumberOfPieces=3, EndPiece=2)


def test_a_file_in_pieces_needs_them_all(tmp_path):
    write_pieces(tmp_path / "v.pvti")
    assert_holds(tmp_path / "v.pvti", VALUES, SPACING)
    piece = tmp_path / "v_1.vti"
    whole = piece.read_bytes()
    piece.write_bytes(whole[:-30])
    with pytest.raises(ArgumentError, match="cut off"):
        open_source(tmp_path / "v.pvti")
    piece.unlink()
    with pytest.raises(
        ArgumentError, match=r"expected a piece v_1\.vti beside it, found none; copy it there"
    ):
        open_source(tmp_path / "v.pvti")
