"""Labels in Python: volumes of them, arrays of them, and labels beside an image, up to a fit."""

import numpy as np
import pytest
import SimpleITK

import texgs
from tests.refusals import refused
from tests.volume.test_label_names import SNAP, layered, written
from texgs.scene.scene_file import read_scene
from texgs.volume.label_names import color_of

SMALL = ("views.train.frequency=1", "fit.seeds.count=400", "fit.shading.iterations=30", "views.step=1")


@pytest.fixture
def labels():
    values = np.zeros((10, 11, 12), np.int16)
    values[2:6, 2:6, 2:7], values[6:9, 6:10, 5:10], values[7, 2, 2] = 5, 2, 900
    return values


def test_each_label_of_an_array_has_a_mask_and_a_function(labels):
    volume = texgs.Volume(labels, kind="labels", spacing=(1, 2, 3))
    assert list(volume.channels) == ["label 2", "label 5", "label 900"]
    functions = volume.suggest()
    assert {name: tf.channel for name, tf in functions.items()} == {
        "label_2": 0,
        "label_5": 1,
        "label_900": 2,
    }
    np.testing.assert_allclose(functions["label_5"].color[0][1:], color_of(5), atol=6e-4)
    for channel, number in enumerate((2, 5, 900)):
        inside = volume.grid.channel(channel).values > 127
        np.testing.assert_array_equal(inside, labels == number)
    assert functions.plot().axes[0].get_xlabel() == "samples"
    assert np.asarray(volume.render(width=60)).std() > 10


def test_labels_of_a_file_are_chosen_and_named_by_a_table(labels, tmp_path):
    SimpleITK.WriteImage(SimpleITK.GetImageFromArray(np.minimum(labels, 2)), tmp_path / "seg.nrrd")
    table = written(tmp_path / "mine.label", SNAP.replace("say ", "bone "))
    volume = texgs.Volume(tmp_path / "seg.nrrd", kind="labels", labels=[2], names=table)
    (name,) = volume.suggest()
    assert (name, volume.suggest()[name].color[0][1:]) == ("bone_aah", (0, 1, 0))
    assert list(volume.channels) == ['label bone "aah"']
    layers, _ = layered(tmp_path / "a.seg.nrrd")
    assert list(texgs.Volume(layers, kind="labels").suggest()) == ["Liver", "Tumour_left"]


def test_labels_beside_an_image_join_its_functions(labels, tmp_path):
    scan = np.random.default_rng(0).normal(20, 5, labels.shape) + 30 * (labels == 5)
    scan = scan.astype(np.float32)
    volume = texgs.Volume(scan, labels=labels, folder=tmp_path / "mine")
    np.testing.assert_array_equal(volume.grid.values, scan)
    assert [*volume.channels] == ["", "label 2", "label 5", "label 900"]
    assert list(volume.suggest(1)) == ["TF01", "label_2", "label_5", "label_900"]
    refused(
        lambda: texgs.Volume(scan, labels=labels[1:]),
        "labels: expected labels on the lattice of data",
    )
    assert list(texgs.Volume(scan).channels) == [""]


def test_slices_show_labels_in_their_colours(labels):
    z, y, x = np.argwhere(labels == 5).mean(axis=0)
    volume = texgs.Volume(labels, kind="labels")
    pixels = np.asarray(volume.slice("all", at=(x, y, z)))
    own = np.rint(255 * np.array(volume.suggest()["label_5"].color[0][1:]))
    assert 0.01 < (pixels == own).all(axis=-1).mean() < 0.5
    place = volume.place(x, y, z)
    assert (place.value, place.labels) == (None, ("label_5",))


@pytest.mark.parametrize("recipe", ["quick", "now"])
def test_a_fit_has_a_model_of_each_label(labels, tmp_path, recipe):
    volume = texgs.Volume(labels, kind="labels", labels=[5, 2], name="organs")
    words = SMALL if recipe == "quick" else ()
    scene = texgs.fit(volume, recipe=recipe, size=32, overrides=words, folder=tmp_path)
    assert scene.parts == ["label_5", "label_2"]
    made = read_scene(scene.session.scene.volume.file.parent / "scene.yaml") if recipe == "now" else None
    assert (made or scene.session.scene).volume.tfs == volume.suggest()
    assert np.asarray(scene.render(width=40)).std() > 10


def test_a_fit_of_an_image_with_a_label_reads_both_from_its_copy(labels, tmp_path):
    scan = np.where(labels == 5, 100, 10).astype(np.float32) + np.arange(12)
    volume = texgs.Volume(scan, labels=labels)
    bone = texgs.TransferFunction([(90, 0.5), (120, 0.5)], [(90, 1, 1, 1)], within=2)
    functions = {"bone": bone, "five": volume.suggest()["label_5"]}
    scene = texgs.fit(volume, functions, size=32, overrides=SMALL, folder=tmp_path)
    assert scene.parts == ["bone", "five"]
    assert [(tf.channel, tf.within) for tf in scene.session.scene.volume.tfs.values()] == [(0, 1), (1, None)]


@pytest.mark.parametrize(
    ("options", "told"),
    [
        ({"kind": "label"}, "kind: expected image or labels, got 'label'"),
        ({"labels": "liver"}, r"labels: expected names or numbers, as in \[3, 'liver'\], got 'liver'"),
        ({"labels": [3]}, "labels: no such label '3'; expected some of 5, 2, 900"),
        ({"names": "missing.txt"}, "missing.txt"),
        ({"crop": (0, 2, 0, 2, 0, 2)}, "data: expected labels, got 0 everywhere"),
    ],
)
def test_mistakes_are_told(labels, options, told):
    refused(lambda: texgs.Volume(labels, **{"kind": "labels", **options}), told)
