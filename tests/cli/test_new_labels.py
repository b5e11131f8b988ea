"""`texgs new` of labels: how they are recognised, named and chosen, alone and beside a scan."""

from pathlib import Path

import nibabel
import numpy as np
import pytest
import SimpleITK
import yaml
from PIL import Image

from texgs.cli.main import main
from texgs.config.compose import compose, recompose
from texgs.volume.label_names import color_of
from texgs.volume.nrrd_file import open_grid
from texgs.volume.summaries import read_summaries

TAKEN = "samples are taken for labels; kind=image reads them as values\n"
TABLE = '1 255 0 0 1 1 1 "liver (left)"\n2 0 255 0 1 1 1 "no"\n3 0 0 255 1 1 1 "TF01"\n'


@pytest.fixture
def conf(tmp_path, monkeypatch):
    """The configurations of a project that has none yet."""
    monkeypatch.chdir(tmp_path)
    return tmp_path / "conf"


@pytest.fixture
def labels():
    """A large ball, a box and a small box."""
    z, y, x = np.mgrid[:24, :20, :18]
    values = np.where((z - 9) ** 2 + (y - 9) ** 2 + (x - 8) ** 2 < 50, 1, 0).astype(np.uint8)
    values[18:22, 3:9, 3:9], values[19:22, 12:15, 12:15] = 2, 3
    return values


def nifti(path, values):
    nibabel.save(nibabel.Nifti1Image(values.T, np.eye(4)), path)
    return path.name


def written(name):
    return yaml.safe_load(Path(f"conf/dataset/{name}.yaml").read_text(encoding="utf-8"))


@pytest.mark.parametrize("dtype", ["int32", "float32", "float64"])
def test_labels_of_any_type_are_recognised(conf, labels, capsys, dtype):
    """FreeSurfer writes 32 bits, and much software floating point."""
    assert main(["new", nifti(conf.parent / "seg.nii.gz", labels.astype(dtype))]) == 0
    assert f"seg: {TAKEN}" in capsys.readouterr().err
    assert recompose(("dataset=seg",)).dataset.labels == ["1", "2", "3"]


@pytest.mark.parametrize(("dtype", "words"), [("uint8", ["--count", "2"]), ("float32", [])])
def test_shells_of_few_values_are_told(conf, labels, capsys, dtype, words):
    values = (labels * (0.5 if dtype == "float32" else 1)).astype(dtype)
    assert main(["new", nifti(conf.parent / "seg.nii.gz", values), *words]) == 0
    assert "as thin shells; kind=labels" in capsys.readouterr().err
    assert "kind" not in written("seg")["volume"]


def test_whole_numbers_of_few_values_are_labels(conf, labels, capsys):
    file = nifti(conf.parent / "seg.nii.gz", labels)
    assert main(["new", file]) == 0
    said = capsys.readouterr()
    assert f"seg: {TAKEN}" in said.err
    assert "of other settings" not in said.out
    document = written("seg")
    assert document["volume"] == {"file": str(conf.parent / file), "up": "+z", "kind": "labels"}
    assert list(document["basic_tfs"]) == ["label_1", "label_2", "label_3"]
    first = document["basic_tfs"]["label_1"]
    assert (first["label"], first["opacity"]) == ("1", [[127.5, 0.95], [255, 0.95]])
    np.testing.assert_allclose(first["color"], [[127.5, *color_of(1)]], atol=6e-4)
    known = read_summaries(conf.parent / "results/seg/volume/volume.nrrd")
    assert list(known) == ["label 1", "label 2", "label 3"]
    assert Image.open("results/seg/transfer/transfer.png").size == (1000, 640)
    assert compose(("dataset=seg",)).dataset.labels == ["1", "2", "3"]
    assert main(["run", "dataset=seg", "fit=quick", "--dry-run"]) == 0


@pytest.mark.parametrize(
    "words", [["kind=image"], ["--count", "2"], ["--series", "seg.nii.gz", "seg2.nii.gz"]]
)
def test_they_are_values_where_that_is_said(conf, labels, capsys, words):
    nifti(conf.parent / "seg2.nii.gz", labels)
    assert main(["new", nifti(conf.parent / "seg.nii.gz", labels), *words]) == 0
    assert TAKEN not in capsys.readouterr().err
    dataset = compose(("dataset=seg",)).dataset
    assert (dataset.volume.kind, dataset.labels) == ("image", [])


def test_samples_that_are_no_whole_numbers_are_no_labels(conf, labels, capsys):
    assert main(["new", nifti(conf.parent / "ct.nii.gz", labels + 0.5), "kind=labels"]) == 2
    assert "ct.nii.gz: expected labels, which are whole numbers, got 0.5; is it" in capsys.readouterr().err


def test_segments_have_the_names_and_colours_of_their_header(conf, labels, capsys):
    image = SimpleITK.GetImageFromArray(labels)
    for k, (name, number) in enumerate([("Liver", 2), ("Gef\u00e4\u00df: links", 1)]):
        for key, value in {"Name": name, "LabelValue": str(number), "Color": f"0.5 0.{k} 0.25"}.items():
            image.SetMetaData(f"Segment{k}_{key}", value)
    SimpleITK.WriteImage(image, "a.seg.nrrd")
    assert main(["new", "a.seg.nrrd"]) == 0
    assert TAKEN in capsys.readouterr().err
    tfs = written("a")["basic_tfs"]
    assert {name: tf["label"] for name, tf in tfs.items()} == {
        "Gef_links": "Gef\u00e4\u00df: links", "Liver": "Liver", "label_3": "3",
    }  # fmt: skip
    assert tfs["Liver"]["color"] == [[127.5, 0.5, 0, 0.25]]
    assert "label_numbers" not in written("a")["volume"]
    assert main(["new", "a.seg.nrrd", "labels=[Liver]", "--name", "b"]) == 0
    assert list(written("b")["basic_tfs"]) == ["Liver"]


def test_a_table_gives_names_colours_and_numbers(conf, labels, capsys):
    file = nifti(conf.parent / "seg.nii.gz", labels)
    (conf.parent / "mine.txt").write_text(TABLE)
    assert main(["new", file, "--names", "mine.txt"]) == 0
    document = written("seg")
    assert document["volume"]["label_numbers"] == {"liver (left)": 1, "no": 2, "TF01": 3}
    assert {name: tf["label"] for name, tf in document["basic_tfs"].items()} == {
        "liver_left": "liver (left)", "label_2": "no", "TF01": "TF01",
    }  # fmt: skip
    assert document["basic_tfs"]["liver_left"]["color"] == [[127.5, 1, 0, 0]]
    capsys.readouterr()
    (conf.parent / "mine.txt").rename("seg.label")
    assert main(["new", file, "--name", "again"]) == 0
    assert "again: names and colours of labels are those of " in capsys.readouterr().err
    assert written("again")["basic_tfs"] == document["basic_tfs"]
    assert main(["new", file, "--names", "missing.txt", "--name", "other"]) == 2
    assert "missing.txt" in capsys.readouterr().err


def test_of_many_labels_the_largest_are_shown_or_those_that_are_asked_for(conf, capsys):
    values = np.zeros((20, 8, 8), np.uint8)
    for number in range(1, 20):
        values[number].flat[: 3 * number] = number
    file = nifti(conf.parent / "many.nii.gz", values)
    assert main(["new", file]) == 0
    told = "many: the 16 largest of 19 labels are shown, without 3, 2, 1; labels=[...] chooses others\n"
    assert told in capsys.readouterr().err
    assert written("many")["basic_tfs"].keys() == {f"label_{number}" for number in range(4, 20)}
    assert main(["new", file, "labels=[2, 19]", "--force"]) == 0
    assert "largest" not in capsys.readouterr().err
    assert [tf["label"] for tf in written("many")["basic_tfs"].values()] == ["2", "19"]


def test_labels_beside_a_scan_join_its_functions(conf, labels, capsys):
    scan = np.random.default_rng(0).normal(20, 5, labels.shape) + 100 * (labels == 1) + 200 * (labels == 2)
    scan_file = nifti(conf.parent / "ct.nii.gz", scan.astype(np.float32))
    file = nifti(conf.parent / "seg.nii.gz", labels)
    (conf.parent / "seg.label").write_text(TABLE)
    assert main(["new", scan_file, f"labels={file}", "labels=[2,TF01]", "reduce=1"]) == 0
    document = written("ct")
    assert document["volume"] == {
        "file": str(conf.parent / scan_file), "labels": str(conf.parent / file), "reduce": 1, "up": "+z",
        "label_numbers": {"no": 2, "TF01": 3},
    }  # fmt: skip
    assert list(document["basic_tfs"]) == ["TF01", "TF02", "label_2", "label_TF01"]
    grid = open_grid("results/ct/volume/volume.nrrd")
    assert [grid.values.dtype, *(each.dtype for each in grid.others)] == [np.float32, np.uint8, np.uint8]
    assert TAKEN not in capsys.readouterr().err
    nifti(conf.parent / "small.nii.gz", labels[1:])
    assert main(["new", scan_file, "labels=small.nii.gz", "--force"]) == 2
    assert "small.nii.gz: expected labels on the lattice of ct.nii.gz" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["labels=[9]"], "labels: no such label '9'; expected some of 1, 2, 3"),
        (["labels=[]"], "labels: expected 1 to 16 labels, got 0"),
        (["labels=[1"], "labels=[1: expected names or numbers of labels, as in labels=[3,5,liver]"),
        (["labels=[[1]]"], "labels=[[1]]: expected names or numbers"),
        (["kind=label"], "dataset.volume.kind"),
        (["kind=labels", "--count", "2"], "--count: expected none, as each label has a function"),
        (["kind=labels", "--tf", "a.json"], "a.json"),
        (["kind=labels", "labels=seg.nii.gz"], "as its file holds labels itself"),
        (
            ["kind=labels", "crop=[0,9,0,9,0,2]", "labels=[3]"],
            "seg.nii.gz: expected labels, got 0 everywhere",
        ),
        (["kind=image", "labels=[3]"], "labels=[...]: expected a file of labels, got an image; name one by"),
    ],
)
def test_mistakes_are_one_sentence_and_write_nothing(conf, labels, capsys, words, message):
    assert main(["new", nifti(conf.parent / "seg.nii.gz", labels), *words]) == 2
    assert message in capsys.readouterr().err.splitlines()[-1]
    assert not conf.exists()


def test_masks_count_for_the_memory(conf, labels, monkeypatch):
    SimpleITK.WriteImage(SimpleITK.GetImageFromArray(labels), "seg.nrrd")
    for room, factor in ((3 * labels.nbytes, 1), (3 * labels.nbytes - 1, 2)):
        monkeypatch.setattr("texgs.core.memory.free_memory", lambda room=room: 2 * room)
        assert main(["new", "seg.nrrd", "kind=labels", "--force"]) == 0
        assert recompose(("dataset=seg",)).dataset.volume.reduce == factor
