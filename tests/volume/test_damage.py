import shutil

import pytest

from tests.real_data import real_data
from tests.volume.volume_files import WRITERS, sample_values
from texgs.core.errors import ArgumentError, ShapeError
from texgs.volume.sources import open_source


def read_whole(path) -> None:
    """Open a file and decode all of it."""
    source = open_source(path)
    source.slices(0, source.dims[2])


def refused(path) -> str:
    """The message of a file that cannot be read to its end."""
    with pytest.raises((ArgumentError, ShapeError)) as caught:
        read_whole(path)
    assert str(path) in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("share", [0.0, 0.02, 0.3, 0.6, 0.97])
@pytest.mark.parametrize("name", WRITERS)
def test_a_file_that_is_cut_off_is_refused_and_the_terminal_stays_clean(tmp_path, capfd, name, share):
    path = tmp_path / name
    WRITERS[name](path, sample_values())
    # A detached header is whole; its samples are not.
    companions = [other for other in tmp_path.iterdir() if other != path]
    victim = companions[0] if companions else path
    victim.write_bytes(victim.read_bytes()[: int(share * victim.stat().st_size)])
    message = refused(path)
    assert "\n" not in message
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("name", WRITERS)
def test_a_foreign_file_is_refused(tmp_path, capfd, name):
    (tmp_path / name).write_bytes(bytes(range(256)) * 40)
    refused(tmp_path / name)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("share", [0.0, 0.1, 0.3, 0.6, 0.97])
def test_slc_that_is_cut_off(tmp_path, share):
    path = tmp_path / "v.slc"
    whole = real_data("volumes/neghip.slc").read_bytes()
    path.write_bytes(whole[: int(share * len(whole))])
    assert "cut off" in refused(path)


def test_vtk_prints_again_afterwards(tmp_path, capfd):
    from vtkmodules.vtkIOXML import vtkXMLImageDataReader

    (tmp_path / "v.vtk").write_text("# vtk nonsense")
    refused(tmp_path / "v.vtk")
    reader = vtkXMLImageDataReader()
    reader.SetFileName(str(tmp_path / "none.vti"))
    reader.Update()
    assert "none.vti" in capfd.readouterr().err


def test_a_slice_of_a_folder_that_is_cut_off(tmp_path):
    WRITERS["packed.tif"](tmp_path / "packed.tif", sample_values()[0])
    shutil.copy(tmp_path / "packed.tif", tmp_path / "z.tif")
    (tmp_path / "z.tif").write_bytes((tmp_path / "z.tif").read_bytes()[:-20])
    source = open_source(tmp_path)
    with pytest.raises(ArgumentError, match=r"z\.tif: expected a TIFF file"):
        source.slices(0, 2)
