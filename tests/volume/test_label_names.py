"""Names and colours of labels: segments of 3D Slicer, tables of ITK-SNAP and FreeSurfer, and by number."""

import nibabel
import numpy as np
import pytest
import SimpleITK

from tests.refusals import refused
from texgs.volume.label_names import (
    Label,
    color_of,
    named_in,
    place_of_label,
    read_table,
    readable,
    segments_of,
)
from texgs.volume.settings import VolumeKeys, open_labels, open_masks
from texgs.volume.sources import open_source, tells_labels

SNAP = """
################################################
# ITK-SnAP Label Description File
################################################
    0     0    0    0        0  0  0    "Clear Label"
    1   255    0   51        1  1  1    "Left ventricle (LV)"
    2     0  255    0     0.50  1  0    "say "aah""
"""
FREESURFER = """#$Id: FreeSurferColorLUT.txt $
#No. Label Name:                            R   G   B   A

0   Unknown                                 0   0   0   0
2   Left-Cerebral-White-Matter              245 245 245 0
-1  left over                               51  0   0   255
"""
SEGMENTS = {
    "Segment0_Name": "Liver",
    "Segment0_LabelValue": "1",
    "Segment0_Color": "0.5 0.25 1",
    "Segment0_Layer": "0",
    "Segment1_Name": "Tumour: left",
    "Segment1_LabelValue": "1",
    "Segment1_Color": "1 0 0",
    "Segment1_Layer": "1",
}


def written(path, text):
    path.write_text(text, encoding="utf-8")
    return path


def layered(path):
    """A segmentation as 3D Slicer writes it where segments overlap: layers along the first axis."""
    layers = np.zeros((4, 5, 6, 2), np.uint8)  # [Z, Y, X, layer]
    layers[1:3, 1:4, 1:4, 0] = 1
    layers[1:3, 1:3, 1:3, 1] = 1
    header = [
        "NRRD0004", "type: uchar", "dimension: 4", "space: left-posterior-superior", "sizes: 2 6 5 4",
        "space directions: none (1,0,0) (0,1,0) (0,0,1)", "kinds: list domain domain domain",
        "endian: little", "encoding: raw", "space origin: (0,0,0)",
        *(f"{key}:={value}" for key, value in SEGMENTS.items()),
    ]  # fmt: skip
    path.write_bytes("\n".join([*header, "", ""]).encode() + layers.tobytes())
    return path, np.moveaxis(layers, 3, 0)


def test_tables_of_itk_snap(tmp_path):
    _, lv, quoted = read_table(written(tmp_path / "seg.label", SNAP))
    assert (lv.number, lv.name, lv.color, lv.is_listed) == (1, "Left ventricle (LV)", (1, 0, 0.2), True)
    assert quoted.name == 'say "aah"'


def test_tables_of_freesurfer_and_slicer(tmp_path):
    _, matter, rest = read_table(written(tmp_path / "lut.txt", FREESURFER))
    assert (matter.number, matter.name) == (2, "Left-Cerebral-White-Matter")
    assert (rest.number, rest.name, rest.color) == (-1, "left over", (0.2, 0, 0))


@pytest.mark.parametrize(
    "line",
    ["1 liver 255 0 0", "1 liver 256 0 0 0", 'x 1 2 3 1 1 1 "liver"', "1", "liver 1 2 3 4"],
)
def test_a_line_of_neither_is_told(tmp_path, line):
    path = written(tmp_path / "bad.txt", f"# ours\n{line}\n")
    refused(
        lambda: read_table(path), r"bad.txt: line 2: expected a label, as '1 255 0 0 1 1 1 \"name\"' of ITK"
    )
    path.write_bytes(b"\xff\xfe\x00")
    refused(lambda: read_table(path), "bad.txt: expected a table of labels")


def test_segments_of_a_header(tmp_path):
    image = SimpleITK.GetImageFromArray(np.ones((3, 3, 3), np.uint8))
    for key, value in {**SEGMENTS, "Segment1_LabelValue": "7", "Segment1_Color": "2 0 0"}.items():
        image.SetMetaData(key, value)
    SimpleITK.WriteImage(image, tmp_path / "a.seg.nrrd")
    liver, tumour = segments_of(tmp_path / "a.seg.nrrd")
    assert liver == Label(1, "Liver", (0.5, 0.25, 1))
    assert tumour == Label(7, "Tumour: left"), "a colour out of range is none"
    assert not segments_of(written(tmp_path / "a.txt", ""))


def test_where_segments_overlap_each_mask_is_of_its_layer(tmp_path):
    path, layers = layered(tmp_path / "a.seg.nrrd")
    assert [each.layer for each in segments_of(path)] == ["0", "1"]
    assert place_of_label(path, "Tumour: left", {}) == ("1", 1)
    volume = VolumeKeys(file=str(path), kind="labels")
    for mask, layer in zip(open_masks(volume, path, ["Liver", "Tumour: left"]), layers, strict=True):
        np.testing.assert_array_equal(mask.slices(0, 4) > 127, layer == 1)
    np.testing.assert_array_equal(open_labels(volume, path, "1").slices(0, 4), layers[1])


def test_a_label_is_found_by_its_name_or_its_number(tmp_path):
    path, _ = layered(tmp_path / "a.seg.nrrd")
    assert place_of_label(path, "heart", {"heart": 9}) == (None, 9)
    assert place_of_label(path, "-12", {}) == (None, -12)
    refused(
        lambda: place_of_label(path, "heart", {"lung": 3}),
        "no such label 'heart'; expected its number, or one of lung, Liver",
    )
    refused(
        lambda: place_of_label(tmp_path / "a.nii", "heart", {}),
        "expected its number, or one of those in dataset.volume.label_numbers",
    )


def test_names_are_text_that_settings_hold_and_never_numbers():
    assert readable(" Liver\n", 3, ()) == "Liver"
    assert readable("${oc.env:HOME}", 3, ()) == "$ {oc.env:HOME}"
    assert [readable(name, 3, ["Liver"]) for name in ("", "???", "7", "-7", "Liver", "\udcff")] == [
        "label 3", "label 3", "7 3", "-7 3", "Liver 3", "label 3",
    ]  # fmt: skip


def test_numbers_of_segments_may_have_gaps(tmp_path):
    image = SimpleITK.GetImageFromArray(np.zeros((4, 4, 4), np.uint8))
    for number, name in ((0, "liver"), (7, "bone")):
        image.SetMetaData(f"Segment{number}_Name", name)
        image.SetMetaData(f"Segment{number}_LabelValue", str(number + 3))
    SimpleITK.WriteImage(image, tmp_path / "a.seg.nrrd")
    assert {(each.number, each.name) for each in segments_of(tmp_path / "a.seg.nrrd")} == {
        (3, "liver"),
        (10, "bone"),
    }


def test_a_table_is_given_or_lies_beside_the_file(tmp_path, monkeypatch):
    path = tmp_path / "seg.v2.nii.gz"
    assert named_in(path, None) == named_in(type(path)(), None) == ([], None)
    written(tmp_path / "seg.v2.txt", "These are my labels.\n")
    assert named_in(path, None) == ([], None), "that is another file"
    table = written(tmp_path / "seg.v2.ctbl", FREESURFER)
    assert named_in(path, None) == (read_table(table), table)
    snap = written(tmp_path / "mine.label", SNAP)
    assert named_in(path, snap) == (read_table(snap), None)
    lut = written(tmp_path / "FreeSurferColorLUT.txt", FREESURFER)
    monkeypatch.setenv("FREESURFER_HOME", str(tmp_path))
    assert named_in(tmp_path / "aseg.mgz", None)[1] == lut
    assert named_in(tmp_path / "aseg.nii", None)[1] is None
    segments, _ = layered(tmp_path / "a.seg.nrrd")
    refused(lambda: named_in(segments, snap), "mine.label: expected none, as a.seg.nrrd names its segments")


def test_files_that_say_that_they_hold_labels(tmp_path):
    image = nibabel.Nifti1Image(np.ones((3, 3, 3), np.uint8), np.eye(4))
    nibabel.save(image, tmp_path / "plain.nii")
    image.header.set_intent("label")
    nibabel.save(image, tmp_path / "labels.nii.gz")
    nibabel.save(nibabel.MGHImage(np.ones((3, 3, 3), np.uint8), np.eye(4)), tmp_path / "a.mgz")
    written(tmp_path / "broken.nii", "x")
    said = {path.name: tells_labels(path) for path in tmp_path.iterdir()}
    assert said == {"plain.nii": False, "labels.nii.gz": True, "a.mgz": False, "broken.nii": False}
    assert tells_labels(tmp_path / "a.SEG.nrrd")
    assert not tells_labels(tmp_path / "missing.nii")
    assert open_source(tmp_path / "labels.nii.gz").dtype == np.uint8


def lab_of(rgb):
    """CIELAB [..., 3] of sRGB under D65, in float64, by the formulas of CIE 15 and IEC 61966-2-1."""
    rgb = np.asarray(rgb, np.float64)
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    rows = [
        [0.4124564, 0.3575761, 0.1804375],
        [0.2126729, 0.7151522, 0.0721750],
        [0.0193339, 0.1191920, 0.9503041],
    ]
    x, y, z = np.moveaxis(linear @ np.array(rows).T / [0.95047, 1, 1.08883], -1, 0)
    x, y, z = (np.where(t > 216 / 24389, np.cbrt(t), (24389 / 27 * t + 16) / 116) for t in (x, y, z))
    return np.stack([116 * y - 16, 500 * (x - y), 200 * (y - z)], axis=-1)


def test_colours_of_16_numbers_in_a_row_can_be_told_apart():
    lab = lab_of([color_of(number) for number in range(-20, 2200)])
    for step in range(1, 16):
        assert np.linalg.norm(lab[step:] - lab[:-step], axis=1).min() > 20
    assert len({color_of(number) for number in range(2200)}) == 2200
    assert lab[:, 0].min() > 35
    assert lab[:, 0].max() < 90
