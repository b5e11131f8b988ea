"""Headers whose samples are in another file: under every suffix that readers take."""

import pytest

from texgs.volume.headers import samples_of


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
