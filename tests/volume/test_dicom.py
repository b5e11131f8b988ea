"""Folders of DICOM slices and files of many frames, as pydicom writes them.

That slices and frames lie where they lay is shown by SimpleITK in `test_space`.
"""

from itertools import product

import numpy as np
import pydicom
import pytest
import SimpleITK as sitk
from pydicom.encaps import encapsulate, generate_frames
from pydicom.uid import RLELossless, RTDoseStorage, RTStructureSetStorage, generate_uid

from tests.volume.dicom_files import (
    AXIAL,
    FRAMES,
    SERIES,
    change,
    frame,
    save,
    write_enhanced,
    write_nuclear,
    write_phases,
    write_series,
    write_steps,
)
from tests.volume.volume_files import assert_holds, sample_values, whole
from texgs.core.errors import ArgumentError
from texgs.volume.sources import open_source

VALUES = sample_values()
SPACING = (0.5, 2, 2.5)
OF_Z = np.arange(5)[:, None, None]


def test_slices_are_sorted_by_place_and_other_files_are_no_slices(tmp_path):
    write_series(tmp_path, VALUES)
    for name in ("DICOMDIR", "notes.txt", "._05-3.dcm"):
        (tmp_path / name).write_text("no slice")
    assert_holds(tmp_path, VALUES, SPACING, (10, 10, 10))
    assert open_source(tmp_path).dtype == np.uint16
    assert open_source(tmp_path, spacing=(1, 2, 3), origin=(4, 5, 6)).spacing == (1, 2, 3)
    change(tmp_path / "00-3.ima", lambda data: data.compress(RLELossless))
    assert_holds(tmp_path, VALUES)


@pytest.mark.parametrize("slopes", [[2] * 5, [1, 0.25, 0.25, 3, 0.25]], ids=["one", "as in PET"])
def test_each_slice_has_its_slope_and_intercept(tmp_path, slopes):
    """The first slice alone would make integers of those of PET."""
    write_series(tmp_path, FRAMES, RescaleSlope=lambda z: slopes[z], RescaleIntercept=lambda z: -100 * z)
    assert_holds(tmp_path, FRAMES * np.reshape(slopes, (5, 1, 1)) - 100 * OF_Z)


def test_one_of_several_series_is_chosen(tmp_path):
    other = generate_uid()
    write_series(tmp_path, VALUES)
    write_series(tmp_path, VALUES[:4] + 1, uid=other, number=5)
    with pytest.raises(ArgumentError, match=r"got several series; choose one by dataset\.volume\.ser") as e:
        open_source(tmp_path)
    assert all(text in str(e.value) for text in (SERIES, other, "3 (Bone, 11 files", "5 (Bone, 4 files"))
    for choice in ("5", other):
        assert_holds(tmp_path, VALUES[:4] + 1, series=choice)
    with pytest.raises(ArgumentError, match="got 0 series for '7'"):
        open_source(tmp_path, series="7")
    write_series(tmp_path, VALUES[:5] + 2, uid=generate_uid(), number=0)
    assert_holds(tmp_path, VALUES[:5] + 2, series="0")


POSITION = {"TemporalPositionIdentifier": lambda step, z: step + 9}


@pytest.mark.parametrize(
    "tags",
    [
        POSITION | {"AcquisitionNumber": lambda step, z: -step},
        {"TriggerTime": lambda step, z: 8.5 * step + 0.1 * (z % 3)},
        {"TriggerTime": lambda step, z: 0, "AcquisitionNumber": lambda step, z: 11 * step + z},
    ],
    ids=["position", "trigger", "acquisition"],
)
def test_volumes_of_one_series_are_steps_in_time(tmp_path, tags):
    """The first tag counts that differs at each place; neither hearts nor counters are even."""
    write_steps(tmp_path, tags)
    for step in range(3):
        assert_holds(tmp_path, VALUES + 100 * step, SPACING, time=step)
    assert open_source(tmp_path).note == "step 0 of 3; dataset.volume.time chooses another"
    assert open_source(tmp_path, series="all", time=2).n_steps == 3


@pytest.mark.parametrize(
    ("tags", "name"),
    [
        (
            {"TemporalPositionIdentifier": lambda t: 9 + t, "SeriesDescription": lambda t: f"{50 - t} %"},
            "7 to 5, ordered by temporal position",
        ),
        (
            {
                "SeriesDescription": lambda t: f"CT 1.5 T={2 * t}0.0% ex",
                "TemporalPositionIdentifier": lambda t: 1,
            },
            "7 to 5, ordered by percentage",
        ),
        (
            {"number": lambda t: 9 + t, "SeriesDescription": lambda t: "50%"},
            "9 to 11, ordered by series number",
        ),
    ],
    ids=["position", "percentage", "number"],
)
def test_series_on_one_lattice_are_steps_in_time(tmp_path, tags, name):
    """The first number that is not the same in all of them counts."""
    write_phases(tmp_path, tags)
    scout = {"number": 2, "uid": generate_uid(), "orientation": (1, 0, 0, 0, 0, -1)}
    write_series(tmp_path, VALUES[:1], SeriesDescription="Scout", **scout)
    for step in range(3):
        assert_holds(tmp_path, FRAMES + 100 * step, SPACING, series="all", time=step)
    left = f"left out, on other lattices: 2 (Scout, 1 files, UID {scout['uid']})"
    assert open_source(tmp_path, series="all").note.endswith(f"; steps are the 3 series {name}; {left}")


@pytest.mark.parametrize("in_folder", [False, True])
def test_frames_in_any_order_have_their_place_and_their_own_slope(tmp_path, in_folder):
    order = [3, 0, 4, 1, 2]
    path = write_enhanced(tmp_path / "e.dcm", FRAMES[order], [frame(z, 0.5 + z, -z) for z in order])
    path = tmp_path if in_folder else path
    assert (open_source(path).n_steps, open_source(path).note) == (1, "")
    assert_holds(path, FRAMES * (0.5 + OF_Z) - OF_Z, SPACING)


def test_whole_numbers_stay_such(tmp_path):
    path = write_enhanced(tmp_path / "e.dcm", FRAMES, [frame(z, 1, -1024) for z in range(5)])
    assert open_source(path).dtype == np.int16
    assert_holds(path, FRAMES.astype(int) - 1024)


@pytest.mark.parametrize("kind", ["JPEG", "JPEG2000"])
def test_frames_that_are_compressed(tmp_path, kind):
    """SimpleITK compresses slices; their streams are frames of one file."""
    streams, writer = [], sitk.ImageFileWriter()
    writer.SetUseCompression(True)
    writer.SetCompressor(kind)
    writer.SetFileName(str(tmp_path / "one.dcm"))
    for plane in FRAMES:
        writer.Execute(sitk.GetImageFromArray(plane))
        one = pydicom.dcmread(tmp_path / "one.dcm")
        streams.append(next(generate_frames(one.PixelData, number_of_frames=1)))

    def compress(data):
        data.PixelData = encapsulate(streams)
        data.file_meta.TransferSyntaxUID = one.file_meta.TransferSyntaxUID
        data["PixelData"].is_undefined_length = True
        data.RescaleSlope = 7  # that of the whole file does not count

    path = write_enhanced(tmp_path / "e.dcm", FRAMES, [frame(z, 2, z) for z in range(5)])
    change(path, compress)
    assert_holds(path, 2 * FRAMES + OF_Z)


def test_steps_in_time_of_frames(tmp_path):
    places = product(range(5), range(2))
    frames = [frame(z, content={"TemporalPositionIndex": 9 + t, "StackID": "1"}) for z, t in places]
    values = np.stack([FRAMES, FRAMES + 100], axis=1).reshape(10, *FRAMES.shape[1:])
    path = write_enhanced(tmp_path / "e.dcm", values, frames)
    for step in range(2):
        assert open_source(path, time=step).note.startswith(f"step {step} of 2")
        assert_holds(path, FRAMES + 100 * step, time=step)


PLANE = {"ImagePositionPatient": [1, 2, 3], "ImageOrientationPatient": list(AXIAL)}
DOSE = {**PLANE, "PixelSpacing": [2.0, 0.5], "FrameIncrementPointer": 0x3004000C}


@pytest.mark.parametrize("first", [0.0, 3.0])
def test_a_dose_has_its_unit(tmp_path, first):
    """Offsets of frames are distances, or places along z."""
    offsets = [first + 2.5 * z for z in range(5)]
    path = save(
        tmp_path / "d.dcm", FRAMES, RTDoseStorage, GridFrameOffsetVector=offsets, DoseGridScaling=0.01, **DOSE
    )
    assert_holds(path, (FRAMES * 0.01).astype(np.float32), SPACING, (1, 2, 3))


def test_slices_of_nuclear_medicine_are_counted(tmp_path):
    path = write_nuclear(tmp_path / "n.dcm")
    assert open_source(path).note.endswith("no place and orientation of frames: they are taken as stored")
    assert_holds(path, FRAMES, SPACING, (0, 0, 0))
    detector = pydicom.Dataset()
    detector.update(PLANE)
    write_nuclear(path, DetectorInformationSequence=[detector], SliceVector=[1, 2, 3, 4, 5])
    assert open_source(path).note == ""
    assert_holds(path, FRAMES, SPACING, (1, 2, 3))


def test_other_objects_beside_slices_are_not_mixed_in(tmp_path):
    write_series(tmp_path, FRAMES)
    save(tmp_path / "s.dcm", None, RTStructureSetStorage)
    assert_holds(tmp_path, FRAMES)
    dose = {"GridFrameOffsetVector": list(range(5)), "DoseGridScaling": 2, "Modality": "RTDOSE"}
    save(tmp_path / "d.dcm", FRAMES, RTDoseStorage, **DOSE, **dose)
    with pytest.raises(ArgumentError, match=r"got several series; .* 8 \(RTDOSE, 1 files"):
        open_source(tmp_path)
    assert_holds(tmp_path, FRAMES, series="3")
    assert_holds(tmp_path, 2 * FRAMES, series="8")


@pytest.mark.parametrize(
    ("stored", "told", "kind", "bits"),
    [(-2000, -2000, "SS", 16), (-2000, 63536, "US", 16), (63536, -2000, "SS", 16), (2096, 63536, "US", 12)],
    ids=["signed", "as unsigned", "of unsigned", "12 bits"],
)
@pytest.mark.parametrize("limit", [0, 3])
def test_padding_takes_the_smallest_value_of_the_rest(tmp_path, stored, told, kind, bits, limit):
    values = FRAMES.astype(int) + 7
    values[:, :3] = stored
    values[:, 0] += limit
    tags = {"PixelRepresentation": int(stored < 0), "BitsStored": bits, "HighBit": bits - 1}
    write_series(tmp_path, values.astype("<i4").astype("<u2"), RescaleSlope=2, RescaleIntercept=-1, **tags)
    change(tmp_path, lambda data: data.add_new(0x00280120, kind, told))
    if limit:
        change(tmp_path, lambda data: data.add_new(0x00280121, kind, told + limit))
    expected = 2 * values - 1
    expected[:, :3] = least = expected[:, 3:].min()
    assert_holds(tmp_path, expected)
    code = 2 * (stored + limit) - 1
    note = f"25 % of the samples are padding ({code}) and take the smallest other value, {least}"
    assert open_source(tmp_path).note == note


def test_padding_of_frames(tmp_path):
    values = FRAMES.astype("<i2") + 7
    values[:, :3] = -2000
    path = write_enhanced(tmp_path / "e.dcm", values, [frame(z, 1 + z) for z in range(5)])
    change(path, lambda data: data.add_new(0x00280120, "SS", -2000))
    expected = values * (1 + OF_Z)
    expected[:, :3] = expected[:, 3:].min()
    np.testing.assert_array_equal(whole(path), expected)


@pytest.mark.parametrize("keyword", ["ImagerPixelSpacing", "NominalScannedPixelSpacing", ""])
def test_a_spacing_that_is_none_of_the_patient_is_told(tmp_path, keyword):
    write_series(tmp_path, FRAMES, **({keyword: [3.0, 0.25]} if keyword else {}))
    change(tmp_path, lambda data: data.pop("PixelSpacing"))
    note = f"{keyword} is taken" if keyword else "samples of a slice are 1 apart"
    assert open_source(tmp_path).note.startswith(f"DICOM tells no PixelSpacing, so that {note}; dataset")
    assert open_source(tmp_path).spacing == ((0.25, 3, 2.5) if keyword else (1, 1, 2.5))
