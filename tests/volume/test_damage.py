"""Damaged files, streams that hold more than their header says, and what readers must not run or wait for."""

import bz2
import gzip
import os
import shutil
import subprocess
import sys

import numpy as np
import pytest
import SimpleITK

from tests.volume.test_netcdf import FIELD, write_netcdf
from tests.volume.test_text_columns import DIMS, LINES, write_lines
from tests.volume.volume_files import NAMES, WRITERS, assert_holds, sample_values, whole, write_slc
from texgs.core.errors import ArgumentError, ShapeError
from texgs.volume.sources import open_source

OTHERS = {
    "v.nc": lambda path, values: write_netcdf(path, {"t": FIELD}),
    "v.txt.gz": lambda path, values: write_lines(path, LINES),
    "plain.slc": write_slc,
    "packed.slc": write_slc,
    "v.gipl": lambda path, values: SimpleITK.WriteImage(SimpleITK.GetImageFromArray(values), path),
}
BY_OTHERS = ("plain.slc", "packed.slc", "v.gipl")  # also in a process of their own
CUT = [*NAMES, "v.nc", "v.txt.gz", *(pytest.param(name, marks=pytest.mark.subprocess) for name in BY_OTHERS)]
KEYS = {"v.txt.gz": {"dims": DIMS, "column": 2}}
HEAD = "NRRD0004\ntype: uchar\ndimension: 3\nsizes: {sizes}\nencoding: {encoding}\n{more}\n"


@pytest.mark.parametrize("share", [0.0, 0.02, 0.6, 0.97])
@pytest.mark.parametrize("name", CUT)
def test_a_file_that_is_cut_off_is_refused_and_the_terminal_stays_clean(tmp_path, capfd, name, share):
    path = tmp_path / name
    {**WRITERS, **OTHERS}[name](path, sample_values())
    # A detached header is whole; its samples are not.
    companions = [other for other in tmp_path.iterdir() if other != path]
    victim = companions[0] if companions else path
    victim.write_bytes(victim.read_bytes()[: int(share * victim.stat().st_size)])
    with pytest.raises((ArgumentError, ShapeError)) as caught:
        whole(path, **KEYS.get(name, {}))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)
    assert capfd.readouterr() == ("", "")


def nrrd(path, sizes="4 3 2", encoding="raw", more="", data=b"\0" * 24):
    path.write_bytes(HEAD.format(sizes=sizes, encoding=encoding, more=more).encode() + data)
    return path


def test_vtk_that_ends_its_process_is_a_sentence(tmp_path, monkeypatch):
    WRITERS["packed.vti"](tmp_path / "packed.vti", sample_values())
    monkeypatch.setattr("sys.executable", shutil.which("false"))
    with pytest.raises(ArgumentError, match=r"packed\.vti: expected a \.vti file, but its reader broke off"):
        open_source(tmp_path / "packed.vti")


def test_a_library_that_cannot_be_imported_is_not_the_fault_of_the_file(tmp_path, monkeypatch):
    WRITERS["packed.vti"](tmp_path / "packed.vti", sample_values())
    (tmp_path / "pyvista.py").write_text("raise ImportError('libGL.so.1: cannot open shared object file')")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(ArgumentError, match=r"packed\.vti: .* packages that read it, got libGL\.so\.1"):
        open_source(tmp_path / "packed.vti")


def test_vtk_in_a_process_of_its_own_runs_nothing_of_the_folder(tmp_path, monkeypatch):
    WRITERS["text.vtk"](tmp_path / "text.vtk", sample_values())
    (tmp_path / "numpy.py").write_text("raise SystemExit('was run')")
    monkeypatch.chdir(tmp_path)
    assert_holds("text.vtk", sample_values())


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


def test_text_and_bytes_to_skip_are_read_as_before(tmp_path):
    values = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    text = " ".join(map(str, values.ravel())).encode()
    path = nrrd(tmp_path / "v.nrrd", encoding="ascii", more="line skip: 1\n", data=b"x\n" + text)
    assert_holds(path, values)
    for skip, extra in (("3", b"abc"), ("-1", b"abcd")):  # NRRD counts bytes after decompression
        packed = gzip.compress(extra + values.tobytes())
        path = nrrd(tmp_path / "g.nrrd", encoding="gzip", more=f"byte skip: {skip}\n", data=packed)
        assert_holds(path, values)


@pytest.mark.parametrize(("encoding", "pack"), [("gzip", gzip.compress), ("bzip2", bz2.compress)])
@pytest.mark.parametrize("behind", [b"", b"\0\0\0"])
def test_streams_behind_each_other_are_one(tmp_path, encoding, pack, behind):
    """As programs write them that pack on several cores; what else is behind them is none."""
    values = np.arange(24, dtype=np.uint8).reshape(2, 3, 4)
    packed = pack(values.tobytes()[:7]) + pack(values.tobytes()[7:]) + behind
    assert_holds(nrrd(tmp_path / "v.nrrd", encoding=encoding, data=packed), values)


@pytest.mark.skipif(os.name == "nt", reason="named pipes are POSIX")
@pytest.mark.parametrize("name", ["v.nrrd", "v.raw"])
def test_a_named_pipe_is_not_waited_for(tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(ArgumentError, match="expected a file or a folder, got a named pipe"):
        open_source(tmp_path / name)
    with pytest.raises(ArgumentError, match="no such file with samples"):
        open_source(nrrd(tmp_path / "h.nhdr", more=f"data file: {name}\n"))
