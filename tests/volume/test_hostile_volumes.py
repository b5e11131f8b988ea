"""Headers that claim more than the file or the machine has, and files that never end."""

import bz2
import gzip
import os
import re
import shutil
import subprocess
import sys

import nibabel
import numpy as np
import pytest
import tifffile

from tests.volume.volume_files import WRITERS, sample_values
from texgs.core.errors import ArgumentError, OutOfMemoryError
from texgs.volume.sources import open_source

HEAD = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: {sizes}\nencoding: {encoding}\n{more}\n"
TERABYTE = "100000 10000 1000"


def nrrd(path, sizes="4 3 2", encoding="raw", more="", data=b"\0" * 24):
    path.write_bytes(HEAD.format(sizes=sizes, encoding=encoding, more=more).encode() + data)
    return path


def test_vtk_that_would_end_the_process_is_refused(tmp_path):
    path = tmp_path / "packed.vti"
    WRITERS["packed.vti"](path, sample_values())
    whole = path.read_bytes()
    claim = re.sub(rb'"0 12 0 11 0 10"', b'"0 99999 0 99999 0 9999"', whole)
    assert claim != whole
    path.write_bytes(claim)
    with pytest.raises(OutOfMemoryError, match=r"packed\.vti: 100000 x 100000 x 10000 samples .* needs"):
        open_source(path)
    path = tmp_path / "binary.vtk"
    WRITERS["binary.vtk"](path, sample_values())
    path.write_bytes(path.read_bytes().replace(b"DIMENSIONS 13 12 11", b"DIMENSIONS 9000 9000 9000"))
    with pytest.raises(OutOfMemoryError, match=r"binary\.vtk: 9000 x 9000 x 9000 samples .* needs 679 GiB"):
        open_source(path)


def test_vtk_that_ends_its_process_is_a_sentence(tmp_path, monkeypatch):
    WRITERS["packed.vti"](tmp_path / "packed.vti", sample_values())
    monkeypatch.setattr("sys.executable", shutil.which("false"))
    with pytest.raises(ArgumentError, match=r"packed\.vti: expected a \.vti file, but its reader broke off"):
        open_source(tmp_path / "packed.vti")


def test_vtk_in_a_process_of_its_own_runs_nothing_of_the_folder(tmp_path, monkeypatch):
    WRITERS["text.vtk"](tmp_path / "text.vtk", sample_values())
    (tmp_path / "numpy.py").write_text("raise SystemExit('was run')")
    monkeypatch.chdir(tmp_path)
    np.testing.assert_array_equal(open_source("text.vtk").slices(0, 11), sample_values())


@pytest.mark.parametrize("encoding", ["gzip", "bzip2"])
def test_packed_nrrd_that_claims_too_much(tmp_path, encoding):
    path = nrrd(tmp_path / "v.nrrd", TERABYTE, encoding, data=gzip.compress(b"\0" * 24))
    with pytest.raises(OutOfMemoryError, match=r"100000 x 10000 x 1000 samples .* needs 1863 GiB of memory"):
        open_source(path)


def test_a_stream_that_holds_more_than_the_header_says_is_not_unpacked(tmp_path):
    bomb = gzip.compress(b"\0" * 200_000_000, 9)
    path = nrrd(tmp_path / "v.nrrd", encoding="gzip", data=bomb)
    code = (
        "import sys; from texgs.core.memory import peak_memory\n"
        "from texgs.volume.sources import open_source\n"
        "try: open_source(sys.argv[1])\nexcept Exception as error: print(error)\n"
        "print(peak_memory())"
    )
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True, check=True)
    message, peak = done.stdout.splitlines()
    assert "expected 24 bytes of samples, found at least 25" in message
    assert int(peak) < 150e6


def test_text_that_is_no_samples_is_refused(tmp_path):
    for text in (b"1 2 x " + b"3 " * 21, b"1 " * 25):
        with pytest.raises(ArgumentError, match=r"expected (24 samples, found 25|an? .?n?rrd file)"):
            open_source(nrrd(tmp_path / "v.nrrd", encoding="ascii", data=text))


def test_a_word_in_place_of_a_number_is_refused(tmp_path):
    text = "NDims = 3\nDimSize = 3 2 2\nElementSpacing = 2 x 2\nElementType = MET_UCHAR\n"
    (tmp_path / "v.mha").write_bytes(text.encode() + b"ElementDataFile = LOCAL\n" + bytes(range(12)))
    with pytest.raises(ArgumentError, match="could not convert string to float: 'x'"):
        open_source(tmp_path / "v.mha")


@pytest.mark.parametrize("encoding", ["raw", "gzip", "ascii"])
def test_lines_to_skip_that_are_not_there(tmp_path, encoding):
    with pytest.raises(ArgumentError, match="line skip: expected no more lines than the file has"):
        open_source(nrrd(tmp_path / "v.nrrd", encoding=encoding, more="line skip: 99999999999\n"))


def test_text_and_bytes_to_skip_are_read_as_before(tmp_path):
    values = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    text = " ".join(map(str, values.ravel())).encode()
    source = open_source(
        nrrd(tmp_path / "v.nrrd", encoding="ascii", more="line skip: 1\n", data=b"x\n" + text)
    )
    np.testing.assert_array_equal(source.slices(0, 2), values)
    for skip, extra in (("3", b"abc"), ("-1", b"abcd")):  # NRRD counts bytes after decompression
        packed = gzip.compress(extra + values.tobytes())
        path = nrrd(tmp_path / "g.nrrd", encoding="gzip", more=f"byte skip: {skip}\n", data=packed)
        np.testing.assert_array_equal(open_source(path).slices(0, 2), values)


@pytest.mark.parametrize(("encoding", "pack"), [("gzip", gzip.compress), ("bzip2", bz2.compress)])
@pytest.mark.parametrize("behind", [b"", b"\0\0\0"])
def test_streams_behind_each_other_are_one(tmp_path, encoding, pack, behind):
    """As programs write them that pack on several cores; what else is behind them is none."""
    values = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    packed = pack(values.tobytes()[:7]) + pack(values.tobytes()[7:]) + behind
    source = open_source(nrrd(tmp_path / "v.nrrd", encoding=encoding, data=packed))
    np.testing.assert_array_equal(source.slices(0, 2), values)


def test_pages_of_a_tiff_that_do_not_fit_into_memory(tmp_path):
    tifffile.imwrite(tmp_path / "packed.tif", sample_values(), compression="zlib")
    with tifffile.TiffFile(tmp_path / "packed.tif", mode="r+") as tiff:
        for page in tiff.pages:
            page.tags["ImageWidth"].overwrite(2_000_000)
            page.tags["ImageLength"].overwrite(2_000_000)
    with pytest.raises(OutOfMemoryError, match=r"2000000 x 2000000 x .* samples"):
        open_source(tmp_path / "packed.tif").slices(0, 1)


def test_a_nifti_that_claims_too_much(tmp_path):
    image = nibabel.Nifti1Image(sample_values("int16").T, np.eye(4))
    image.header.set_data_shape((30000, 30000, 30000))
    packed = gzip.compress(image.header.binaryblock + b"\0" * 4 + sample_values("int16").tobytes())
    (tmp_path / "v.nii.gz").write_bytes(packed)
    with pytest.raises(OutOfMemoryError, match="30000 x 30000 x 30000 samples"):
        open_source(tmp_path / "v.nii.gz")


@pytest.mark.skipif(os.name == "nt", reason="named pipes are POSIX")
@pytest.mark.parametrize("name", ["v.nrrd", "v.vti", "v.nii.gz", "v.raw", "v.npy"])
def test_a_named_pipe_is_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(ArgumentError, match="expected a file or a folder, got a named pipe"):
        open_source(tmp_path / name)
    with pytest.raises(ArgumentError, match="no such file with samples"):
        open_source(nrrd(tmp_path / "h.nhdr", more=f"data file: {name}\n"))
