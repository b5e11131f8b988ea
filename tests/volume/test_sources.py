import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.volume.volume_files import WRITERS, sample_values
from texgs.core.errors import ArgumentError
from texgs.volume.grid import Grid
from texgs.volume.headers import samples_of
from texgs.volume.slabs import ArraySource, slab_bounds
from texgs.volume.sources import open_source

DIMS = (13, 12, 11)


@pytest.mark.parametrize("endian", ["little", "big"])
@pytest.mark.parametrize("dtype", ["uint8", "int16", "float32", "float64"])
def test_plain_samples(tmp_path, dtype, endian):
    values = sample_values(dtype)
    order = np.dtype(dtype).newbyteorder("<" if endian == "little" else ">")
    (tmp_path / "v.RAW").write_bytes(b"header" + values.astype(order).tobytes())
    source = open_source(tmp_path / "v.RAW", dims=DIMS, dtype=dtype, endian=endian, skip=6, spacing=(1, 2, 3))
    assert (source.dims, source.dtype, source.spacing, source.origin) == (DIMS, dtype, (1, 2, 3), (0, 0, 0))
    assert source.dtype.isnative
    np.testing.assert_array_equal(source.slices(3, 7), values[3:7])


def test_slabs_cover_the_range_in_multiples():
    source = ArraySource(Grid(np.zeros((100, 512, 1024), np.float32)))  # 2 MiB a slice, 8 MiB a slab
    assert slab_bounds(source, 3, 12) == [(3, 7), (7, 11), (11, 12)]
    assert slab_bounds(source, 0, 13, multiple=3) == [(0, 3), (3, 6), (6, 9), (9, 12), (12, 13)]
    assert slab_bounds(source, 0, 20, multiple=9) == [(0, 9), (9, 18), (18, 20)]


def test_plain_file_that_shrinks_while_it_is_read(tmp_path):
    path = tmp_path / "v.raw"
    path.write_bytes(sample_values("uint8").tobytes())
    source = open_source(path, dims=DIMS, dtype="uint8")
    path.write_bytes(b"short")
    with pytest.raises(ArgumentError, match="cut off while it was read"):
        source.slices(0, 11)


@pytest.mark.parametrize("name", ["raw.nrrd", "packed.nii.gz", "pages.tif", "array.h5", "v.raw"])
def test_a_file_without_permission_is_one_sentence(tmp_path, monkeypatch, name):
    """The tests may run as root, who may read everything: opening the file is made to fail."""
    path = tmp_path / name
    WRITERS.get(name, lambda path, values: path.write_bytes(values.tobytes()))(path, sample_values())

    def refuse(self, *_arguments, **_options):
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "open", refuse)
    arguments = {"dims": DIMS, "dtype": "uint16"} if name == "v.raw" else {}
    with pytest.raises(ArgumentError) as caught:
        open_source(path, **arguments)
    assert str(caught.value) == f"{path}: cannot be read (Permission denied)"


def test_what_the_other_process_runs_counts_as_code_of_a_job():
    from texgs.workflow.code import ROOT, essence

    seen, waiting = set(), ["texgs.workflow.stages.volume"]
    while waiting:
        name = waiting.pop()
        read = essence(name, ROOT)
        if name not in seen and read is not None:
            seen.add(name)
            waiting += read[1]
    assert {f"texgs.volume.{name}" for name in ("foreign", "dicom", "itk_image", "vtk_image")} <= seen


@pytest.mark.parametrize(
    ("name", "line"),
    [
        ("v.mhd", "ElementDataFile = v.raw"),
        ("v.mha", "ElementDataFile = v.raw"),
        ("v.mhd", "  ElementDataFile=v.raw"),
        ("v.nhdr", "data file: v.raw"),
        ("v.nrrd", "datafile: v.raw"),
    ],
)
def test_the_file_with_the_samples_is_named(tmp_path, name, line):
    header = tmp_path / name
    header.write_text(f"NRRD0004\n{line}\nlast\n")
    assert samples_of(header) is None, "it is not there"
    (tmp_path / "v.raw").write_bytes(b"samples")
    assert samples_of(header) == tmp_path / "v.raw"
    header.write_text(f"NRRD0004\n{line.replace('v.raw', 'LOCAL')}\n")
    assert samples_of(header) is None


def test_libraries_of_formats_are_loaded_when_a_file_of_theirs_is_opened():
    """Zarr alone takes a quarter of a second."""
    heavy = {"zarr", "h5py", "scipy", "nibabel", "torch", "vtkmodules", "pyvista", "tifffile", "SimpleITK"}
    code = f"import sys, texgs.volume.sources, texgs.volume.prepare; print({heavy} & {{*sys.modules}})"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
