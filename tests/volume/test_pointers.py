"""What stands in place of files, of each format alike."""

import gzip
import zipfile

import pytest

from tests.volume.volume_files import WRITERS, assert_holds, sample_values
from texgs.core.errors import ArgumentError
from texgs.volume.sources import FORMATS, open_source

POINTER = "version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 52428800\n"
LOGIN = "\n<!DOCTYPE html>\n<html><head><title>Sign in</title></head></html>"


@pytest.mark.parametrize("suffix", FORMATS)
@pytest.mark.parametrize(("text", "what"), [(POINTER, "a pointer of Git LFS"), (LOGIN, "a page of HTML")])
def test_pointers_and_pages_are_told(tmp_path, suffix, text, what):
    (tmp_path / f"v{suffix}").write_text(text)
    with pytest.raises(ArgumentError, match=f"v{suffix}: expected a file, got {what} in its place; "):
        open_source(tmp_path / f"v{suffix}")


@pytest.mark.parametrize("suffix", [".tif", ".dcm"])
def test_in_a_folder_of_slices(tmp_path, suffix):
    (tmp_path / f"s1{suffix}").write_text(POINTER)
    with pytest.raises(ArgumentError, match=f"s1{suffix}: expected a file, got a pointer of Git LFS"):
        open_source(tmp_path)
    (tmp_path / f"s1{suffix}").unlink()
    (tmp_path / f"s1{suffix}").symlink_to("objects/s1")
    with pytest.raises(
        ArgumentError, match=f"s1{suffix}: a link to objects/s1, which is not there; get it, as"
    ):
        open_source(tmp_path)


def test_links_and_samples_beside_a_header(tmp_path):
    (tmp_path / "v.nii.gz").symlink_to("../.git/annex/objects/v")
    with pytest.raises(
        ArgumentError, match=r"a link to \.\./\.git/annex/objects/v, which is not there; .* annex"
    ):
        open_source(tmp_path / "v.nii.gz")
    WRITERS["raw.nhdr"](tmp_path / "v.nhdr", sample_values())
    (tmp_path / "v.raw").write_text(POINTER)
    with pytest.raises(ArgumentError, match="got a pointer of Git LFS"):
        open_source(tmp_path / "v.nhdr")


def test_packing_that_the_name_does_not_say(tmp_path):
    WRITERS["plain.nii"](tmp_path / "v.nii", sample_values())
    content = (tmp_path / "v.nii").read_bytes()
    (tmp_path / "plain.nii.gz").write_bytes(content)
    with pytest.raises(ArgumentError, match=r"expected gzip, got another file; .*, rename it to plain\.nii$"):
        open_source(tmp_path / "plain.nii.gz")
    (tmp_path / "v.nii").write_bytes(gzip.compress(content))
    with pytest.raises(ArgumentError, match=r"is not packed, got gzip; rename it to v\.nii\.gz$"):
        open_source(tmp_path / "v.nii")
    (tmp_path / "v.nii").rename(tmp_path / "v.nii.gz")
    assert_holds(tmp_path / "v.nii.gz", sample_values())
    samples = b"\x1f\x8b" + bytes(22)
    (tmp_path / "v.raw").write_bytes(samples)
    assert open_source(tmp_path / "v.raw", dims=(4, 3, 2), dtype="uint8").slices(0, 1)[0, 0, 0] == 0x1F


def test_a_zip_of_other_files(tmp_path):
    with zipfile.ZipFile(tmp_path / "v.zip", "w") as archive:
        for number in range(9):
            archive.writestr(f"ct/{number}.dcm", "x")
    with pytest.raises(
        ArgumentError, match=r"a zip of Zarr, got one of ct/0.dcm, .*ct/2.dcm \.\.\.; unpack it"
    ):
        open_source(tmp_path / "v.zip")
