"""A scene knows the labels whose masks its functions count: a volume that was made again is refused."""

from dataclasses import replace

import yaml

from tests.refusals import refused
from tests.scene.labelled import PATIENT, SPACING, labelled_scene, labels
from texgs.scene.scene_file import read_scene, write_scene
from texgs.scene.session import Session
from texgs.volume.grid import Grid
from texgs.volume.label_masks import MaskSource
from texgs.volume.nrrd_file import masks_in
from texgs.volume.prepare import prepare_channels
from texgs.volume.slabs import ArraySource


def test_masks_of_other_labels_are_refused_where_a_scene_names_its_own(tmp_path):
    scene = labelled_scene(tmp_path, with_image=False)
    named = replace(scene.volume, labels=tuple(masks_in(scene.volume.file)))
    file = write_scene(tmp_path / "scene.yaml", replace(scene, volume=named))
    assert read_scene(file).volume.labels == named.labels == ("1", "2")
    assert Session(read_scene(file)).twin_of(read_scene(file)).grid.dims == (31, 26, 20)
    numbers = ArraySource(Grid(labels(), SPACING, space=PATIENT), "scan")
    prepare_channels([MaskSource(numbers, 2), MaskSource(numbers, 1)], named.file)
    refused(lambda: read_scene(file).volume.open(), "expected masks of the labels 1, 2, .* got 2, 1; make")
    assert replace(named, labels=()).open().dims == (31, 26, 20)  # of a scene that names none


def test_labels_of_a_scene_file_are_names(tmp_path):
    file = write_scene(tmp_path / "scene.yaml", labelled_scene(tmp_path))
    values = yaml.safe_load(file.read_text())
    assert "labels" not in values["volume"]
    for wrong in ("bone", [1], {"a": "b"}):
        values["volume"]["labels"] = wrong
        file.write_text(yaml.safe_dump(values))
        refused(lambda: read_scene(file), r"volume.labels: expected a list of names, got")
