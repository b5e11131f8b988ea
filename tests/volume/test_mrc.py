"""MRC and maps of cryo-EM, as mrcfile writes them."""

import gzip
from itertools import permutations

import mrcfile
import numpy as np
import pytest

from tests.volume.volume_files import assert_holds, sample_values
from texgs.core.errors import ArgumentError
from texgs.volume.slabs import RawSource
from texgs.volume.sources import open_source


def write(path, values, **fields):
    """Write [Z, Y, X] with a spacing of 1, 2, 3, and fields of the header."""
    kind = "gzip" if path.suffix == ".gz" else None
    with mrcfile.new(path, values, compression=kind, overwrite=True) as file:
        file.voxel_size = (1.0, 2.0, 3.0)
        file.set_volume()
        for name, value in fields.items():
            file.header[name] = value


@pytest.mark.parametrize("name", ["v.mrc", "v.MAP", "v.ccp4", "v.rec", "v.map.gz"])
@pytest.mark.parametrize("dtype", ["int8", "int16", "uint16", "float32", "float16"])
def test_maps_and_their_types(tmp_path, name, dtype):
    values = sample_values(dtype)
    write(tmp_path / name, values)
    assert_holds(tmp_path / name, values, (1, 2, 3), (0, 0, 0))
    assert open_source(tmp_path / name).dtype == dtype
    assert isinstance(open_source(tmp_path / name), RawSource) is not name.endswith(".gz"), "read on demand"


@pytest.mark.parametrize("axes", list(permutations((1, 2, 3))))
@pytest.mark.parametrize("name", ["v.mrc", "v.map.gz"])
def test_columns_rows_and_sections_may_be_along_any_axes(tmp_path, axes, name):
    """Cell, intervals and origin are along x, y, z; sizes and starts along columns, rows and sections."""
    values = sample_values("int16")  # of x, y and z
    stored = values.transpose([3 - axis for axis in reversed(axes)])
    fields = dict(zip(("mapc", "mapr", "maps"), axes, strict=True))
    fields |= dict(
        zip(("nxstart", "nystart", "nzstart"), [(4, 5, 6)[axis - 1] for axis in axes], strict=True)
    )
    fields |= {"mx": 13, "my": 12, "mz": 11, "cella": (13, 24, 33)}
    write(tmp_path / name, np.ascontiguousarray(stored), **fields)
    assert_holds(tmp_path / name, values, (1, 2, 3), (4, 10, 18))
    write(tmp_path / name, np.ascontiguousarray(stored), **fields, origin=(-1, 7, 0))
    assert_holds(tmp_path / name, values, (1, 2, 3), (-1, 7, 0))


def test_a_map_without_a_cell_says_so(tmp_path):
    write(tmp_path / "v.map", sample_values(), cella=(0, 0, 0))
    source = open_source(tmp_path / "v.map")
    assert (source.spacing, source.note[:24]) == ((1, 1, 1), "MRC tells no spacing, so")
    assert open_source(tmp_path / "v.map", spacing=(1, 2, 3)).note == ""


@pytest.mark.parametrize(
    ("fields", "message"),
    [
        ({"mapc": 2}, r"rows and sections along x, y, z, got axes \[2, 2, 3\]"),
        ({"cellb": (90, 90, 120)}, r"axes at right angles, got \[90.0, 90.0, 120.0\]; resample the map"),
        ({"ispg": 401, "nz": 10, "mz": 5}, "expected one volume, got a stack of 2; take it apart"),
        ({"mode": 4}, "expected integers, floats or bool, got complex64"),
        ({"mode": 77}, "expected an MRC file, got"),
        ({"nz": 12}, "cut off"),
    ],
)
def test_other_maps_are_refused(tmp_path, fields, message):
    write(tmp_path / "v.mrc", sample_values())
    data = bytearray((tmp_path / "v.mrc").read_bytes())
    header = np.frombuffer(data, mrcfile.dtypes.HEADER_DTYPE, 1)
    for field, value in fields.items():
        header[field] = value
    (tmp_path / "v.mrc").write_bytes(data)
    with pytest.raises(ArgumentError, match=message):
        open_source(tmp_path / "v.mrc")


@pytest.mark.parametrize("name", ["v.mrc", "v.map.gz"])
@pytest.mark.parametrize("end", "<>")
@pytest.mark.parametrize(("word", "flag", "is_signed"), [(27, 20140, True), (39, 1, True), (39, 0, False)])
def test_bytes_of_mrc_have_a_sign_where_the_header_says_so(tmp_path, end, word, flag, is_signed, name):
    values = np.arange(-60, 60, dtype=np.int8).reshape(4, 5, 6)
    header = np.zeros(256, f"{end}i4")
    header[[0, 1, 2, 7, 8, 9, 16, 17, 18]] = [6, 5, 4, 6, 5, 4, 1, 2, 3]
    header[10:16] = np.array([6, 5, 4, 90, 90, 90], f"{end}f4").view(f"{end}i4")
    header[52:54] = np.frombuffer(b"MAP DD\0\0" if end == "<" else b"MAP \x11\x11\0\0", f"{end}i4")
    header[38], header[word] = 1146047817 if word == 39 else 0, flag
    content = header.tobytes() + values.tobytes()
    (tmp_path / name).write_bytes(gzip.compress(content) if name.endswith(".gz") else content)
    source = open_source(tmp_path / name)
    expected = values if is_signed else values.view(np.uint8)
    assert source.dtype == expected.dtype
    np.testing.assert_array_equal(source.slices(0, 4), expected)
