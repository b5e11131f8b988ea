"""NRRD and MetaImage with an axis besides those of space, as pynrrd and SimpleITK write them."""

import nrrd
import numpy as np
import pytest
import SimpleITK as sitk

from tests.volume.volume_files import assert_holds, sample_values, whole
from texgs.volume.sources import open_source

VALUES = np.stack([sample_values(), sample_values() + 100, sample_values() + 200])  # [T, Z, Y, X]
STEPS = np.array([[0.5, 0, 0], [0, 2.0, 0], [0, 0, 3.0]])
NONE = [[np.nan] * 3]
pytestmark = pytest.mark.subprocess


def write_nrrd(path, place, kind, encoding, **fields):
    """Write with the axis at a place from the fastest."""
    kinds, directions = ["domain"] * 3, list(STEPS)
    kinds.insert(place, kind)
    directions.insert(place, NONE[0])
    header = {"space": "left-posterior-superior", "space directions": np.array(directions), "kinds": kinds}
    header |= {"space origin": [4, 5, 6], "encoding": encoding, **fields}
    nrrd.write(str(path), np.moveaxis(VALUES, 0, 3 - place).copy(), header, index_order="C")


@pytest.mark.parametrize("place", range(4))
@pytest.mark.parametrize(("name", "encoding"), [("v.nrrd", "raw"), ("v.nhdr", "gzip")])
def test_one_of_the_axis_is_read_wherever_it_is(tmp_path, place, encoding, name):
    write_nrrd(tmp_path / name, place, "time", encoding)
    for time in range(3):
        assert_holds(tmp_path / name, VALUES[time], (0.5, 2, 3), (4, 5, 6), time=time)
        assert open_source(tmp_path / name, time=time).note.startswith(f"step {time} of 3")


@pytest.mark.parametrize("kind", ["list", "vector", "RGB-color"])
def test_a_channel_or_a_layer_is_chosen(tmp_path, kind):
    words = {"content": "an image of four", "Segment0_Name": "of a left lung"}
    write_nrrd(tmp_path / "v.seg.nrrd", 0, kind, "gzip", **words)
    assert_holds(tmp_path / "v.seg.nrrd", VALUES[2], (0.5, 2, 3), channel="2")
    assert open_source(tmp_path / "v.seg.nrrd", channel="2").note == ""


def test_a_list_of_a_sequence_is_one_in_time(tmp_path):
    write_nrrd(tmp_path / "v.seq.nrrd", 0, "list", "gzip")
    assert_holds(tmp_path / "v.seq.nrrd", VALUES[1], (0.5, 2, 3), time=1)


def test_a_last_axis_of_which_nothing_is_told_is_time(tmp_path):
    nrrd.write(str(tmp_path / "v.nrrd"), VALUES, {"spacings": [1, 2, 3, np.nan]}, index_order="C")
    assert_holds(tmp_path / "v.nrrd", VALUES[0], (1, 2, 3))


@pytest.mark.parametrize("name", ["v.mha", "v.mhd"])
@pytest.mark.parametrize("is_compressed", [False, True])
def test_steps_and_components_of_metaimage(tmp_path, name, is_compressed):
    steps = sitk.GetImageFromArray(VALUES, isVector=False)
    steps.SetSpacing((0.5, 2, 3, 9))
    steps.SetOrigin((4, 5, 6, 7))
    turned = np.eye(4)
    turned[:2, :2] = [[0, 1], [1, 0]]
    steps.SetDirection(turned.ravel().tolist())
    sitk.WriteImage(steps, tmp_path / name, is_compressed)
    for time in range(3):
        expected = VALUES[time].transpose(0, 2, 1)  # x and y change places
        assert_holds(tmp_path / name, expected, (2, 0.5, 3), (4, 5, 6), time=time)
    colours = sitk.GetImageFromArray(np.moveaxis(VALUES, 0, 3).copy(), isVector=True)
    sitk.WriteImage(colours, tmp_path / name, is_compressed)
    np.testing.assert_array_equal(whole(tmp_path / name, channel="1"), VALUES[1])
