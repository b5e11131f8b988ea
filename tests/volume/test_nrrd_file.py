import io

import nrrd
import numpy as np
import pytest
import pyvista

from tests.volume.volume_files import SPACING, WRITERS, sample_values
from texgs.core.errors import ArgumentError
from texgs.volume.grid import Grid
from texgs.volume.nrrd_file import ALIGNMENT, NRRD_TYPES, open_grid, write_header
from texgs.volume.prepare import prepare
from texgs.volume.slabs import ArraySource
from texgs.volume.space import UNKNOWN_SPACE

ORIGIN = (-1.5, 1e-9, 1 / 3)


def written(path, dtype):
    """A canonical file of the sample volume."""
    prepare(ArraySource(Grid(sample_values(dtype), SPACING, ORIGIN)), path)
    return path


@pytest.mark.parametrize("dtype", NRRD_TYPES)
def test_round_trip_is_exact_and_mapped_and_other_readers_agree(tmp_path, dtype):
    path = written(tmp_path / "v.nrrd", dtype)
    grid = open_grid(path)
    assert isinstance(grid.values, np.memmap)
    assert not grid.values.flags.writeable
    assert grid.values.offset % ALIGNMENT == 0
    assert (grid.values.dtype, grid.spacing, grid.origin) == (dtype, SPACING, ORIGIN)
    np.testing.assert_array_equal(grid.values, sample_values(dtype))
    values, header = nrrd.read(str(path), index_order="C")
    np.testing.assert_array_equal(values, sample_values(dtype))
    np.testing.assert_array_equal(header["space directions"], np.diag(SPACING))
    np.testing.assert_array_equal(header["space origin"], ORIGIN)
    image = pyvista.read(path)
    assert (image.dimensions, image.spacing, image.origin) == ((13, 12, 11), SPACING, pytest.approx(ORIGIN))
    np.testing.assert_array_equal(image.active_scalars, sample_values(dtype).ravel())


def test_header_is_padded_for_every_length():
    for width in range(1, 130):
        file = io.BytesIO()
        length = write_header(file, (10**width, 2, 2), np.dtype("uint8"), SPACING, ORIGIN, UNKNOWN_SPACE, 1)
        assert length == len(file.getvalue())
        assert length % ALIGNMENT == 0
        assert file.getvalue().endswith(b"\n\n")
        assert file.getvalue().count(b"\n\n") == 1


def test_mistakes_are_named(tmp_path):
    whole = written(tmp_path / "v.nrrd", "uint16").read_bytes()
    WRITERS["gzip.nrrd"](tmp_path / "gzip.nrrd", sample_values())
    for name, content, message in [
        ("none.nrrd", None, r"none.nrrd: no such file; texgs volume dataset=NAME makes it"),
        ("foreign.nrrd", bytes(1000), r"foreign.nrrd: expected an NRRD file, but it does not start"),
        ("v.nrrd", whole[:-1], r"v.nrrd: the file is cut off: expected 13 x 12 x 11 x 2 \(uint16"),
        ("v.nrrd", whole[:100], r"v.nrrd: expected an NRRD file.*makes it again"),
        ("gzip.nrrd", None, "prepared volume with raw encoding, got gzip; texgs volume"),
    ]:
        if content is not None:
            (tmp_path / name).write_bytes(content)
        with pytest.raises(ArgumentError, match=message):
            open_grid(tmp_path / name)


def test_opening_reads_nothing_but_the_header(tmp_path):
    path = tmp_path / "v.nrrd"
    with path.open("wb") as file:
        length = write_header(file, (2048, 2048, 2048), np.dtype("uint8"), SPACING, ORIGIN, UNKNOWN_SPACE, 1)
        file.truncate(length + 2048**3)  # sparse: takes no room on the disk
    grid = open_grid(path)
    assert grid.dims == (2048, 2048, 2048)
    assert grid.values[2047, 2047, 2047] == 0
