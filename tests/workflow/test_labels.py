"""A data set of labels, alone or beside an image: what its keys may say, and what its jobs make of it."""

from dataclasses import replace

import numpy as np
import pytest

from tests.refusals import refused
from texgs.config.dataset import Dataset
from texgs.config.schema import Config
from texgs.core.errors import ConfigError, MissingDataError
from texgs.core.io import read_json
from texgs.volume.basic_tfs import BasicTF, basic_tf_of, basic_tfs_of, function_of
from texgs.volume.nrrd_file import open_grid
from texgs.volume.settings import VolumeKeys
from texgs.volume.summaries import read_summaries
from texgs.workflow.checks import check_basic_tfs
from texgs.workflow.locate import labels_file
from texgs.workflow.stages.volume import Settings, work

STEP = {"opacity": [[127.5, 0.95], [255.0, 0.95]], "color": [[127.5, 0.9, 0.2, 0.1]]}
VALUES = {"opacity": [[10.0, 0.5], [20.0, 0.5]], "color": [[10.0, 0.9, 0.2, 0.1]]}


def data_set(tfs, kind="labels", **volume):
    return Dataset("mine", "mine", volume=VolumeKeys(file="a.npy", kind=kind, **volume), basic_tfs=tfs)


@pytest.mark.parametrize(
    ("tfs", "volume", "told"),
    [
        (
            {"a": BasicTF(**STEP)},
            {},
            "mine: basic TF a: expected a label, as the volume holds labels, got none",
        ),
        (
            {"a": BasicTF(**STEP, label="1")},
            {"labels": "b.npy"},
            "dataset.volume.labels of mine: expected none",
        ),
        (
            {"a": BasicTF(**STEP, label="1", channel="0")},
            {},
            "basic TF a: expected a channel or a label, got both",
        ),
        (
            {"a": BasicTF(**STEP, label="1")},
            {"kind": "image"},
            "basic TF a: expected no label, as .*names no file",
        ),
        ({"a": BasicTF(**VALUES, within="1")}, {"kind": "image"}, "basic TF a: expected no label"),
        (
            {f"a{k}": BasicTF(**STEP, label=str(k)) for k in range(17)},
            {},
            "mine: basic TFs: expected at most 16 channels and labels together, got 17; leave some out",
        ),
    ],
)
def test_keys_that_do_not_fit_are_told(tfs, volume, told):
    refused(lambda: check_basic_tfs(data_set(tfs, **volume)), told, ConfigError)


def test_a_series_has_no_labels():
    dataset = replace(data_set({"a": BasicTF(**STEP, label="1")}), series=["a.npy", "b.npy"])
    refused(lambda: check_basic_tfs(dataset), "dataset.series of mine: expected no labels", ConfigError)


def test_functions_overlap_within_a_mask_only():
    tfs = {
        "whole": BasicTF(**VALUES),
        "inside": BasicTF(**VALUES, within="1"),
        "other": BasicTF(**VALUES, within="liver"),
        "label": BasicTF(**STEP, label="1"),
    }
    dataset = data_set(tfs, "image", labels="b.npy")
    check_basic_tfs(dataset)
    assert dataset.prepared == ["", "label 1", "label liver"]
    again = replace(dataset, basic_tfs={**tfs, "twice": BasicTF(**VALUES, within="1")})
    refused(lambda: check_basic_tfs(again), "basic TFs .*inside.*twice")
    for points in tfs.values():
        assert basic_tf_of(function_of(points, dataset.prepared), dataset.prepared) == points
    shown = function_of(tfs["inside"], dataset.prepared)
    for wrong, told in (
        ({"channel": 3}, r"channel: .*\[0, 1, 2\], got 3"),
        ({"within": 0}, r"within: .*\[1, 2\]"),
    ):
        refused(lambda keys=wrong: basic_tf_of(replace(shown, **keys), dataset.prepared), told)


def prepared(folder, dataset, **inputs):
    settings = Settings(
        stage="volume",
        dataset="mine",
        stand_in="",
        volume=dataset.volume,
        channels=dataset.channels,
        labels=dataset.labels,
        prepared=dataset.prepared,
    )
    work(settings, inputs, folder)
    return folder / "volume.nrrd"


@pytest.fixture
def files(tmp_path):
    """A scan, and labels 3 and 5 of it."""
    labels = np.zeros((6, 7, 8), np.uint8)
    labels[1:4, 1:4, 1:5], labels[4:, 4:, 5:] = 3, 5
    np.save(tmp_path / "labels.npy", labels)
    np.save(tmp_path / "scan.npy", (20.0 * labels + np.arange(8)).astype(np.float32))
    return tmp_path / "scan.npy", tmp_path / "labels.npy"


def test_labels_alone_are_channels_by_their_names(files, tmp_path):
    tfs = {"liver": BasicTF(**STEP, label="liver"), "five": BasicTF(**STEP, label="5")}
    file = prepared(tmp_path, data_set(tfs, label_numbers={"liver": 3}), source=files[1])
    assert list(read_summaries(file)) == ["label liver", "label 5"]
    for channel, number in enumerate((3, 5)):
        inside = open_grid(file).channel(channel).values > 127
        np.testing.assert_array_equal(inside, np.load(files[1]) == number)
    made = basic_tfs_of(file, tfs, "data")
    assert [(tf.channel, tf.support) for tf in made.values()] == [(0, (127.5, 255)), (1, (127.5, 255))]
    refused(
        lambda: basic_tfs_of(file, {"b": BasicTF(**STEP, label="7")}, "data"),
        "basic TF b: expected a channel of .*label liver, label 5.*, got label 7",
    )


def test_labels_beside_an_image_are_behind_it(files, tmp_path):
    tfs = {"bone": BasicTF(**VALUES, within="3"), "five": BasicTF(**STEP, label="5")}
    dataset = data_set(tfs, "image", labels="labels.npy")
    file = prepared(tmp_path, dataset, source=files[0], labels=files[1])
    grid = open_grid(file)
    np.testing.assert_array_equal(grid.values, np.load(files[0]))
    assert [each.dtype for each in grid.others] == [np.uint8] * 2
    made = basic_tfs_of(file, tfs, "data")
    assert [(tf.channel, tf.within) for tf in made.values()] == [(0, 1), (2, None)]
    shares = BasicTF([[0.0, 0.5], [0.5, 0.5]], [[0.0, 1, 1, 1]], within="3")
    made = basic_tfs_of(file, {"bone": shares, "five": tfs["five"]}, "fraction")
    high = float(np.load(files[0]).max())
    assert [tf.support for tf in made.values()] == [(0, high / 2), (127.5, 255)]
    assert read_json(tmp_path / "volume.json")["channels"]["label 3"]["dtype"] == "uint8"


def test_one_label_keeps_its_name(files, tmp_path):
    file = prepared(tmp_path, data_set({"a": BasicTF(**STEP, label="5")}), source=files[1])
    assert list(read_summaries(file)) == ["label 5"]


def test_a_file_of_labels_that_is_not_there_is_told(tmp_path):
    dataset = data_set({"a": BasicTF(**STEP, label="1")}, "image", labels="seg.nii.gz")
    config = Config(dataset=dataset, data_folder=str(tmp_path))
    told = "data set mine: dataset.volume.labels: .*seg.nii.gz is not there; put it there"
    refused(lambda: labels_file(config), told, MissingDataError)
