"""Files that a volume is in besides the one that is named, which its results depend on."""

import h5py
import numpy as np
import pyvista
import tifffile

from tests.volume.test_hdf5 import VALUES, write, write_virtual
from tests.volume.volume_files import WRITERS, sample_values
from texgs.volume.parts import parts_of


def names_of(path):
    return [each.name for each in parts_of(path)]


def test_files_that_hdf5_links_to_or_is_made_of(tmp_path):
    path, _ = write_virtual(tmp_path)
    assert names_of(path) == ["part0.h5", "part1.h5", "part2.h5"]
    write(tmp_path / "far.h5", data=VALUES)
    with h5py.File(tmp_path / "v.h5", "w") as file:
        file["entry/frames"] = h5py.ExternalLink("far.h5", "data")
        file["entry/lost"] = h5py.ExternalLink("gone.h5", "data")
    assert names_of(tmp_path / "v.h5") == ["far.h5"]


def test_pieces_of_vtk_files_of_one_ome_tiff_and_samples_beside_a_header(tmp_path):
    pieces = (
        '<VTKFile type="PImageData"><Piece Extent="0 1" Source="a.vti"/><Piece Source="gone.vti"/></VTKFile>'
    )
    (tmp_path / "v.pvti").write_text(pieces)
    pyvista.ImageData(dimensions=(2, 2, 2)).save(tmp_path / "a.vti")
    assert names_of(tmp_path / "v.pvti") == ["a.vti"]
    entry = '<TiffData IFD="0"><UUID FileName="{}">urn:uuid:{}</UUID></TiffData>'
    entries = "".join(entry.format(name, name) for name in ("one.ome.tif", "two.ome.tif"))
    text = (
        f'<?xml version="1.0"?><OME xmlns="http://www.openmicroscopy.org/Schemas/OME/2016-06">{entries}</OME>'
    )
    for name in ("one.ome.tif", "two.ome.tif"):
        tifffile.imwrite(tmp_path / name, np.zeros((3, 4), "u1"), description=text, metadata=None)
    assert names_of(tmp_path / "two.ome.tif") == ["one.ome.tif"]
    WRITERS["plain.mhd"](tmp_path / "plain.mhd", sample_values())
    assert names_of(tmp_path / "plain.mhd") == ["plain.raw"]


def test_what_is_damaged_or_in_one_piece_has_no_others(tmp_path):
    for name in ("v.h5", "v.tif", "v.mhd", "v.pvti", "v.nii.gz"):
        (tmp_path / name).write_bytes(b"\x89HDF\r\n\x1a\nnonsense")
        assert parts_of(tmp_path / name) == []
    assert parts_of(write(tmp_path / "whole.h5", data=VALUES)) == []
    assert parts_of(tmp_path / "missing.h5") == []
