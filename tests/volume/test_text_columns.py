"""Text files in the layout of the contest of 2008, against NumPy arrays."""

import gzip

import numpy as np
import pytest

from texgs.core.errors import ArgumentError
from texgs.volume.prepare import prepare
from texgs.volume.sources import open_source

DIMS = (6, 5, 4)
TABLE = np.random.default_rng(0).random((120, 10)).astype(np.float32)
LINES = [" ".join(f"{number:.9E}" for number in row) for row in TABLE]


def write_lines(path, lines, end="\n"):
    """Write lines, gzipped where the name says so."""
    text = ("\n".join(lines) + end).encode()
    path.write_bytes(gzip.compress(text) if path.suffix == ".gz" else text)
    return path


@pytest.mark.parametrize("name", ["multifield.0099.txt.gz", "multifield.0099.txt"])
@pytest.mark.parametrize("column", [1, 2, 10])
def test_a_column_slab_by_slab_and_in_any_order(tmp_path, name, column):
    """The loops of the contest's page: for z, for y, for x."""
    source = open_source(write_lines(tmp_path / name, LINES), dims=DIMS, column=column, spacing=(1, 2, 3))
    assert (source.dims, source.dtype, source.spacing) == (DIMS, "float32", (1, 2, 3))
    values = TABLE[:, column - 1].reshape(4, 5, 6)
    for start, stop in [(0, 1), (1, 3), (0, 4), (2, 3)]:
        np.testing.assert_array_equal(source.slices(start, stop), values[start:stop])


def test_blanks_around_numbers_and_after_the_last_line(tmp_path):
    lines = ["  " + line.replace(" ", " \t ") + " " for line in LINES]
    for end in ("", "\n", "\n\n"):
        source = open_source(write_lines(tmp_path / "v.txt", lines, end), dims=DIMS, column=3)
        np.testing.assert_array_equal(source.slices(0, 4).ravel(), TABLE[:, 2])


def test_a_single_column_needs_no_number(tmp_path):
    path = write_lines(tmp_path / "v.txt", [line.split()[4] for line in LINES])
    np.testing.assert_array_equal(open_source(path, dims=DIMS).slices(0, 4).ravel(), TABLE[:, 4])


def test_a_line_that_is_too_short_is_named_by_its_place(tmp_path):
    path = write_lines(tmp_path / "v.txt", [*LINES[:50], "1 2", *LINES[51:]])
    source = open_source(path, dims=DIMS, column=4)
    with pytest.raises(ArgumentError, match=r"got 1 that are NaN or infinite, the first at .* \(2, 3, 1\)"):
        prepare(source, tmp_path / "v.nrrd")
