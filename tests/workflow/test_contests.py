"""Data sets that read the files of contests as they are published: tiny files in their layout."""

import hashlib

import numpy as np
import pytest

from tests.volume.test_netcdf import FIELD, write_netcdf
from tests.volume.test_text_columns import LINES, TABLE, write_lines
from texgs.cli.main import main
from texgs.core.io import read_json
from texgs.volume.nrrd_file import open_grid


def contest_file(folder, name):
    """Write the file that a data set names, and return it with the samples [Z, Y, X] to expect."""
    if name == "mantle":
        fields = {"temperature": FIELD + 9, "temperature anomaly": FIELD}
        return write_netcdf(folder / "spherical001.nc", fields), FIELD[::-1]  # z runs south
    return write_lines(folder / "multifield.0099.txt.gz", LINES), TABLE[:, 1].reshape(4, 5, 6)


def keys(name, folder):
    """Overrides for a file with 6 x 5 x 4 samples."""
    return [f"dataset={name}", f"data_folder={folder}", *["dataset.volume.dims=[6,5,4]"] * (name != "mantle")]


@pytest.mark.parametrize("name", ["mantle", "ionization"])
def test_the_file_of_the_contest_becomes_the_volume_with_its_checksum(tmp_path, monkeypatch, capsys, name):
    monkeypatch.chdir(tmp_path)
    assert main(["volume", *keys(name, tmp_path)]) == 2
    assert "is not there; download " in capsys.readouterr().err
    path, values = contest_file(tmp_path, name)
    assert main(["volume", *keys(name, tmp_path)]) == 0
    grid = open_grid(tmp_path / "results" / name / "volume" / "volume.nrrd")
    np.testing.assert_array_equal(grid.values, values)
    assert grid.spacing == (1, 1, 1)
    identity = read_json(tmp_path / "results" / name / "volume" / ".job.json")
    assert identity["inputs"] == {"source": hashlib.sha256(path.read_bytes()).hexdigest()}
