"""`texgs init` and `texgs new`: a project whose files compose, and data sets from volume files."""

import os
import subprocess
import sys

import h5py
import nibabel
import numpy as np
import pytest
import yaml
from PIL import Image

from tests.volume.zarr_files import LABELS, all_axes, axes_of, write_image
from texgs.cli import new_tfs
from texgs.cli.main import main
from texgs.config.compose import compose, recompose
from texgs.config.project import ROOT, groups, members
from texgs.core.io import write_json
from texgs.volume.nrrd_file import open_grid
from texgs.volume.sources import tells_superior
from texgs.volume.suggest import COLORS
from texgs.volume.transfer import TransferFunction

# no text to YAML, or no name of a file
NO_NAMES = ["no", "on", "null", "true", "Off", "nan", "inf", "1e3", "a" * 300]


@pytest.fixture
def conf(tmp_path, monkeypatch):
    """The configurations of a project that has none yet."""
    monkeypatch.chdir(tmp_path)
    return tmp_path / "conf"


@pytest.fixture
def scan(tmp_path):
    """Air, and two materials."""
    random = np.random.default_rng(0)
    values = random.normal(20, 5, (24, 20, 16))
    values[6:18, 5:15, 4:12] = random.normal(120, 6, (12, 10, 8))
    values[9:15, 8:12, 6:10] = random.normal(220, 6, (6, 4, 4))
    np.save(tmp_path / "my scan.v2.npy", values.astype(np.float32))
    return tmp_path / "my scan.v2.npy"


def test_a_data_set_with_suggested_tfs(conf, scan, capsys):
    assert main(["new", str(scan), "--name", "my_scan", "up=+z", "spacing=[1,1,2]"]) == 0
    out = capsys.readouterr().out
    assert "then: texgs run dataset=my_scan fit=quick\n" in out
    config = compose(("dataset=my_scan",))
    assert config.dataset.volume.up == "+z"
    assert config.dataset.volume.spacing == [1, 1, 2]
    assert len(config.dataset.basic_tfs) == 2
    first, second = config.dataset.basic_tfs.values()
    assert (
        first.opacity[0][0] < 120 < first.opacity[-1][0] <= second.opacity[0][0] < 220 < second.opacity[-1][0]
    )
    assert (conf.parent / "results" / "my_scan" / "transfer" / "transfer.png").exists()
    text = (conf / "dataset" / "my_scan.yaml").read_text()
    assert yaml.safe_load(text)["volume"]["file"] == str(scan)


def test_an_image_with_channels_and_time_says_what_is_taken_and_keeps_what_was_asked_for(conf, scan, capsys):
    values = all_axes(np.load(scan), steps=3)
    path = write_image(
        conf.parent / "cells.ome.zarr", [values], axes_of("tczyx"), [(1, 1, 2, 1, 1)], labels=LABELS
    )
    assert main(["new", str(path), "channel=CY5"]) == 2
    assert "expected one of 0 (DAPI), 1 (GFP), 2 (RFP), got CY5" in capsys.readouterr().err
    assert main(["new", str(path), "channel=1"]) == 0
    told = capsys.readouterr().err
    assert "cells: step 0 of 3; dataset.volume.time chooses another\n" in told
    np.testing.assert_array_equal(open_grid("results/cells/volume/volume.nrrd").values, np.load(scan) + 10)
    assert main(["new", str(path), "channel=RFP", "time=2", "--force"]) == 0
    grid = open_grid("results/cells/volume/volume.nrrd")
    np.testing.assert_array_equal(grid.values, np.load(scan) + 220)
    assert grid.spacing == (1, 1, 2)
    text = (conf / "dataset" / "cells.yaml").read_text()
    assert yaml.safe_load(text)["volume"] == {"file": str(path), "channel": "RFP", "time": 2}


def omero(label, color, start, end):
    """What OMERO keeps of a channel."""
    return {
        "label": label,
        "color": color,
        "active": True,
        "window": {"min": 0, "max": 999, "start": start, "end": end},
    }


def cells(folder, scan, shown, *, other=lambda values: values + 10):
    """An image of as many channels as are described, each 10 above the one before."""
    channels = [np.load(scan)]
    while len(channels) < len(shown or range(2)):
        channels.append(other(channels[-1]))
    return write_image(
        folder / "cells.zarr", [np.stack(channels)], axes_of("czyx"), [(1, 1, 1, 1)], labels=shown
    )


def test_channels_become_functions_of_their_colour_and_window(conf, scan, capsys):
    """All but the last, which has no window: its function comes from the histogram, its colour from texgs."""
    shown = [
        omero("DAPI", "0000FF", 50, 150),
        omero("405 nm", "00FF80", -5, 9999),
        {"label": "RFP", "color": "FF0000"},
    ]
    path = cells(conf.parent, scan, shown)
    assert main(["new", str(path), "reduce=2"]) == 0
    out = capsys.readouterr().out
    assert "cells.yaml: 3 transfer functions of the channels DAPI, 405 nm, RFP to edit; " in out
    assert "then: texgs run dataset=cells fit=quick\n" in out
    assert [path.name for path in (conf / "dataset").iterdir()] == ["cells.yaml"]
    document = yaml.safe_load((conf / "dataset" / "cells.yaml").read_text())
    assert document["volume"] == {"file": str(path), "reduce": 2}
    assert [tf["channel"] for tf in document["basic_tfs"].values()] == ["DAPI", "405 nm", "RFP"]
    tfs = compose(("dataset=cells",)).dataset.basic_tfs
    assert list(tfs) == ["DAPI", "channel_405_nm", "RFP"]
    dapi, nm, rfp = tfs.values()
    grid = open_grid("results/cells/volume/volume.nrrd")
    np.testing.assert_allclose(dapi.opacity, [[50, 0], [150, 0.3], [grid.values.max(), 0.3]], rtol=1e-5)
    np.testing.assert_allclose(dapi.color, [[50, 0, 0, 1]])
    ends = np.array([grid.others[0].min(), grid.others[0].max()])
    np.testing.assert_allclose(nm.opacity, np.stack([ends, 0.3 * (ends + 5) / 10004], axis=1), rtol=1e-5)
    np.testing.assert_allclose(nm.color[0][1:], [0, 1, 128 / 255], atol=1e-6)
    assert rfp.color[0][1:] == list(COLORS[2])
    assert main(["new", str(path)]) == 2
    assert "cells: is there already" in capsys.readouterr().err
    assert main(["run", "dataset=cells", "fit=quick", "--dry-run"]) == 0


def test_one_channel_of_several_is_a_data_set_as_ever(conf, scan):
    path = cells(conf.parent, scan, ["a", "b"])
    assert main(["new", str(path), "channel=b", "--name", "second"]) == 0
    dataset = compose(("dataset=second",)).dataset
    assert (dataset.volume.channel, dataset.channels, list(dataset.basic_tfs)) == ("b", [], ["TF01", "TF02"])
    grid = open_grid("results/second/volume/volume.nrrd")
    np.testing.assert_array_equal(grid.values, np.load(scan) + 10)
    assert not grid.others


def test_channels_whose_labels_are_no_names_have_numbers(conf, scan):
    path = cells(conf.parent, scan, ["a b", "a_b"])
    assert main(["new", str(path), "--name", "two"]) == 0
    tfs = compose(("dataset=two",)).dataset.basic_tfs
    assert {name: tf.channel for name, tf in tfs.items()} == {"channel_0": "0", "channel_1": "1"}


@pytest.mark.parametrize(
    ("labels", "names"),
    [
        (["DAPI", "scene"], ["channel_0", "channel_1"]),  # a folder of texgs
        (["no", "yes"], ["channel_0", "channel_1"]),
        (["405", "channel_405"], ["channel_0", "channel_1"]),
        (["405", "_x"], ["channel_405", "channel__x"]),
        (["l" * 300, "a"], ["channel_0", "channel_1"]),
        (["GFP", "gamma/2"], ["GFP", "gamma_2"]),
    ],
)
def test_functions_have_the_names_of_channels_as_far_as_these_are_names(labels, names):
    assert new_tfs.tf_names(labels) == names


def test_a_count_and_files_are_for_each_channel(conf, scan, capsys):
    path = cells(conf.parent, scan, ["a", "b"])
    assert main(["new", str(path), "--count", "2"]) == 0
    tfs = compose(("dataset=cells",)).dataset.basic_tfs
    assert {name: tf.channel for name, tf in tfs.items()} == {
        f"{channel}_{tf}": channel for channel in "ab" for tf in ("TF01", "TF02")
    }
    functions = [TransferFunction(((x, 0), (x + 9, 1)), ((x, 1, 0, 0),)).to_dict() for x in (90, 91)]
    files = [
        write_json(conf.parent / f"{k}.json", {"format": "texgs-tf", "version": 1, **points})
        for k, points in enumerate(functions)
    ]
    assert main(["new", str(path), "--force", "--tf", *map(str, files)]) == 0
    tfs = recompose(("dataset=cells",)).dataset.basic_tfs
    assert [(tf.channel, tf.opacity[0][0]) for tf in tfs.values()] == [("a", 90), ("b", 91)]
    assert main(["new", str(path), "--force", "--tf", str(files[0])]) == 2
    assert "--tf: expected a file for each of the channels a, b, got 1\n" in capsys.readouterr().err


def test_what_memory_does_not_hold_is_made_smaller(conf, tmp_path, monkeypatch, capsys):
    values = np.random.default_rng(0).integers(0, 255, (16, 20, 24)).astype(np.uint8)
    with h5py.File(tmp_path / "big.h5", "w") as file:
        file["density"] = values
    monkeypatch.setattr("texgs.core.memory.free_memory", lambda: 2 * values.nbytes)
    assert main(["new", "big.h5", "--name", "fits"]) == 0
    assert compose(("dataset=fits",)).dataset.volume.reduce == 1
    assert "memory" not in capsys.readouterr().err
    monkeypatch.setattr("texgs.core.memory.free_memory", lambda: 2 * values.nbytes // 8 - 1)
    assert main(["new", "big.h5", "--name", "small"]) == 0
    said = (
        "small: its samples would take more than half of the memory that is free, so that each side is made 4"
    )
    assert said in capsys.readouterr().err
    assert compose(("dataset=small",)).dataset.volume.reduce == 4
    assert open_grid(tmp_path / "results/small/volume/volume.nrrd").dims == (6, 5, 4)
    for words in (["reduce=1"], ["crop=[0,12,0,10,0,8]"]):
        assert main(["new", "big.h5", "--name", "asked", "--force", *words]) == 0
    assert compose(("dataset=asked",)).dataset.volume.reduce == 2, "of what is left"
    assert main(["new", "big.h5", "--name", "asked", "--force", "crop=[0,12,0]"]) == 2
    assert "crop: expected six integers x0, x1, y0, y1, z0, z1, got [0, 12, 0]" in capsys.readouterr().err


def test_the_picture_shows_what_functions_show_where_memory_is_enough(conf, scan, monkeypatch, capsys):
    assert main(["new", str(scan), "--name", "shown"]) == 0
    monkeypatch.setattr("texgs.workflow.stages.transfer.free_memory", lambda: 1000)
    assert main(["new", str(scan), "--name", "large"]) == 0
    assert "large: too large for the memory that is free to picture its TFs\n" in capsys.readouterr().err
    pictures = [Image.open(f"results/{name}/transfer/transfer.png") for name in ("shown", "large")]
    assert [picture.size for picture in pictures] == [(1000, 640), (1000, 450)]


def test_channels_count_for_the_memory(conf, scan, monkeypatch):
    image, taken = cells(conf.parent, scan, [{"label": name} for name in LABELS]), 3 * np.load(scan).nbytes
    monkeypatch.setattr("texgs.core.memory.free_memory", lambda: 2 * taken)
    assert main(["new", str(image), "--name", "whole"]) == 0
    monkeypatch.setattr("texgs.core.memory.free_memory", lambda: 2 * taken - 1)
    assert main(["new", str(image), "--name", "half"]) == 0
    factors = [compose((f"dataset={name}",)).dataset.volume.reduce for name in ("whole", "half")]
    assert factors == [1, 2]


def test_channels_have_no_steps_in_time(conf, scan, capsys):
    path = cells(conf.parent, scan, ["a", "b"])
    assert main(["new", str(path), "--series", str(path)]) == 2
    assert "dataset.series of cells: expected one channel, got a, b" in capsys.readouterr().err
    assert not (conf / "dataset").exists()


def test_a_channel_that_cannot_be_read_leaves_no_data_set_of_the_others(conf, scan, capsys):
    values = np.stack([np.load(scan), np.full_like(np.load(scan), 3)])
    path = write_image(
        conf.parent / "x.zarr", [values], axes_of("czyx"), [(1, 1, 1, 1)], labels=["a", "empty"]
    )
    assert main(["new", str(path)]) == 2
    assert not conf.exists()


def test_a_data_set_is_only_replaced_where_that_is_asked_for_and_that_of_texgs_never(conf, scan, capsys):
    shipped = (ROOT / "conf" / "dataset" / "engine.yaml").read_bytes()
    refused = "texgs new: engine: is {} already; choose another --name, or {} it with --force\n"
    assert main(["new", str(scan), "--name", "engine"]) == 2
    assert capsys.readouterr().err == refused.format("a data set of texgs", "hide")
    assert main(["new", str(scan), "--name", "engine", "--force"]) == 0
    capsys.readouterr()
    assert main(["new", str(scan), "--name", "engine"]) == 2
    assert capsys.readouterr().err == refused.format("there", "replace")
    assert (ROOT / "conf" / "dataset" / "engine.yaml").read_bytes() == shipped
    assert compose(("dataset=engine",)).dataset.volume.file == str(scan)


def test_z_of_nifti_points_up_and_keys_may_have_their_whole_name(conf, scan):
    nifti = conf.parent / "head.nii.gz"
    nibabel.save(nibabel.Nifti1Image(np.load(scan), np.eye(4)), nifti)
    assert main(["new", str(nifti), "dataset.volume.reduce=2"]) == 0
    assert main(["new", str(nifti), "--name", "lying", "up=+y"]) == 0
    volumes = {name: compose((f"dataset={name}",)).dataset.volume for name in ("head", "lying")}
    assert (volumes["head"].up, volumes["head"].reduce) == ("+z", 2)
    assert (volumes["lying"].up, volumes["lying"].reduce) == ("+y", 1)
    assert tells_superior(conf.parent), "a folder is of DICOM where no format says otherwise"


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["missing.nrrd"], "missing.nrrd"),
        (["{scan}", "rreduce=2"], "dataset.volume.rreduce: no such key"),
        (["{scan}", "--name", "a/b"], "--name: expected a letter"),
        (["{scan}", "--count", "2", "--tf", "a.json"], "--count: expected none beside --tf"),
        (["{scan}", "file=b.npy"], "in front, to be the only file"),
        (["{scan}", "--series", "{scan}"], "expected two files at least"),
        (["{scan}", "--series", "{scan}", "up=+z"], "up=+z: the option before takes it for a file"),
        (["{scan}", "--tf", "a.json", "up=+z"], "up=+z: the option before takes it for a file"),
        *((["{scan}", "--name", name], "texgs new: --name: ") for name in NO_NAMES),
    ],
)
def test_mistakes_write_nothing(conf, scan, capsys, words, message):
    assert main(["new", *(word.format(scan=scan) for word in words)]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert message in line
    assert not conf.exists()
    assert not [*conf.parent.glob("results/*")], "nothing of a volume that cannot be read stays"


@pytest.mark.parametrize(
    "folder",
    ["\U0001f52c scans", "x\u200dy", "no: [1, #2]", 'it\'s "quoted"', "tab\tline\nend", "back\\slash $HOME"],
)
def test_any_path_is_read_again_without_a_way_back_in_it(conf, scan, tmp_path, folder):
    file = tmp_path / folder / "scan.npy"
    file.parent.mkdir()
    scan.rename(file)
    assert main(["new", f"{folder}/../{folder}/scan.npy", "--name", "mine"]) == 0
    assert compose(("dataset=mine",)).dataset.volume.file == str(file)


@pytest.mark.parametrize("name", ["${oc.env:HOME}.npy", "${.npy", "a\udcff.npy"])
def test_a_path_that_no_configuration_can_hold_is_refused(conf, scan, tmp_path, capsys, name):
    scan.rename(tmp_path / name)
    assert main(["new", str(tmp_path / name), "--name", "mine"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith("rename it")
    assert not conf.exists()


@pytest.mark.parametrize("name", ["\u626b\u63cf.npy", "42.npy", "volume.npy"])
def test_a_file_whose_name_is_none_for_a_data_set_says_what_to_do(conf, scan, tmp_path, capsys, name):
    scan.rename(tmp_path / name)
    assert main(["new", name]) == 2
    assert capsys.readouterr().err.startswith(f"texgs new: {name}: pass --name: ")
    assert main(["new", name, "--name", "mine"]) == 0


def test_where_python_reads_ascii_alone_a_path_in_utf8_is_not_to_be_renamed(conf, scan, tmp_path):
    scan.rename(tmp_path / "\u00fc.npy")
    ascii_alone = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    command = [sys.executable, "-m", "texgs.cli.main", "new", b"\xc3\xbc.npy", "--name", "mine"]
    done = subprocess.run(command, cwd=tmp_path, env=ascii_alone, capture_output=True, text=True)
    assert done.returncode == 2
    assert done.stderr.endswith("expected a path that Python reads as UTF-8; set PYTHONUTF8=1\n")
    done = subprocess.run(command, cwd=tmp_path, env={**ascii_alone, "PYTHONUTF8": "1"}, capture_output=True)
    assert done.returncode == 0


def test_tfs_of_a_narrow_range_far_from_zero_keep_their_digits(conf, tmp_path):
    """A field of 1e8 and 1e8 + 8: six digits would make both ends of the TF the same."""
    values = np.full((8, 8, 8), 1e8, np.float32)
    values[2:6, 2:6, 2:6] += 8
    np.save(tmp_path / "far.npy", values)
    assert main(["new", "far.npy", "--name", "far", "kind=image"]) == 0
    (tf,) = compose(("dataset=far",)).dataset.basic_tfs.values()
    first, last = tf.opacity[0][0], tf.opacity[-1][0]
    assert 1e8 < first < 1e8 + 8 <= last < 1e8 + 9
    assert tf.color[0][0] == first


def test_tfs_from_files_keep_every_digit(conf, scan, tmp_path):
    tf = TransferFunction(((100.12345678901234, 0), (120, 0.5), (140, 0)), ((100, 1, 0, 0),))
    write_json(tmp_path / "tf.json", {"format": "texgs-tf", "version": 1, **tf.to_dict()})
    assert main(["new", str(scan), "--name", "mine", "--tf", "tf.json"]) == 0
    (read,) = compose(("dataset=mine",)).dataset.basic_tfs.values()
    assert [tuple(point) for point in read.opacity] == list(tf.opacity)


def test_a_project_composes_and_is_left_as_it_is(tmp_path, monkeypatch, capsys):
    assert main(["init", str(tmp_path)]) == 0
    assert "README.md" in capsys.readouterr().out
    monkeypatch.chdir(tmp_path)
    assert "example" in members("experiment")
    assert "engine" in members("dataset")
    assert "README" not in groups()
    assert compose(("experiment=example",)).fit.name == "demo"
    (tmp_path / "README.md").write_text("mine")
    files = {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()}
    assert main(["init", str(tmp_path)]) == 0
    assert "is a project already" in capsys.readouterr().out
    assert {path: path.read_bytes() for path in tmp_path.rglob("*") if path.is_file()} == files


def test_a_folder_of_something_else_is_refused(tmp_path, capsys):
    (tmp_path / "thesis.tex").write_text("mine")
    assert main(["init", str(tmp_path)]) == 2
    assert "got thesis.tex; choose another" in capsys.readouterr().err
    assert main(["init", str(tmp_path / "thesis.tex")]) == 2
    assert "got a file" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["thesis.tex"]


def test_the_project_may_have_defaults_of_its_own(conf):
    text = (ROOT / "conf" / "config.yaml").read_text().replace("dataset: turbulence", "dataset: jets")
    (conf / "dataset").mkdir(parents=True)
    (conf / "config.yaml").write_text(text)
    assert compose().dataset.name == "jets"
