"""Folders of DICOM slices, as pydicom writes them."""

from functools import partial

import numpy as np
import pydicom
import pytest
from pydicom.uid import CTImageStorage, ExplicitVRLittleEndian, JPEG2000Lossless, RLELossless, generate_uid

from tests.volume.volume_files import assert_holds, sample_values, whole
from texgs.core.errors import ArgumentError
from texgs.volume.sources import open_source

AXIAL = (1, 0, 0, 0, 1, 0)
SERIES = generate_uid()


def write_series(folder, values, places=None, uid=SERIES, number=3, orientation=AXIAL, **tags):
    """Write slices [Z, Y, X] of 16 bits as files whose names say nothing about their order.

    Tags are values, or functions of the number of a slice.
    """
    normal = np.cross(orientation[:3], orientation[3:])
    places = [10 + 2.5 * z * normal for z in range(len(values))] if places is None else places
    for z, (plane, place) in enumerate(zip(values, places, strict=True)):
        data = pydicom.Dataset()
        data.file_meta = pydicom.dataset.FileMetaDataset()
        data.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
        data.file_meta.MediaStorageSOPClassUID = data.SOPClassUID = CTImageStorage
        data.file_meta.MediaStorageSOPInstanceUID = data.SOPInstanceUID = generate_uid()
        data.SeriesInstanceUID, data.SeriesNumber, data.SeriesDescription = uid, number, "Bone"
        data.Modality, data.InstanceNumber = "CT", z + 1
        data.ImagePositionPatient, data.ImageOrientationPatient = [float(x) for x in place], list(orientation)
        data.PixelSpacing = [2.0, 0.5]  # of rows, and of samples in a row
        data.Rows, data.Columns = plane.shape
        data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
        data.BitsAllocated, data.BitsStored, data.HighBit, data.PixelRepresentation = 16, 16, 15, 0
        data.PixelData = plane.astype("<u2").tobytes()
        for name, value in tags.items():
            setattr(data, name, value(z) if callable(value) else value)
        data.save_as(folder / f"{(7 * z) % 101:02}-{number}.ima", enforce_file_format=True)


def test_slices_are_sorted_by_place_and_have_their_lattice(tmp_path):
    write_series(tmp_path, sample_values())
    source = open_source(tmp_path)
    assert (source.dims, source.dtype) == ((13, 12, 11), np.uint16)
    assert (source.spacing, source.origin) == ((0.5, 2, 2.5), (10, 10, 10))
    np.testing.assert_array_equal(source.slices(0, 11), sample_values())
    assert open_source(tmp_path, spacing=(1, 2, 3), origin=(4, 5, 6)).spacing == (1, 2, 3)


def test_slope_and_intercept_are_applied(tmp_path):
    write_series(tmp_path, sample_values(), RescaleSlope=2, RescaleIntercept=-1024)
    expected = 2.0 * sample_values() - 1024
    assert_holds(tmp_path, expected)


def test_slopes_that_differ_from_slice_to_slice(tmp_path):
    """As in PET: the first slice alone would make integers of all."""
    write_series(tmp_path, sample_values()[:1], number=3)
    places = [10 + 2.5 * z * np.array([0, 0, 1]) for z in (1, 2, 3)]
    write_series(tmp_path, sample_values()[1:4], places, number=4, RescaleSlope=0.25, RescaleIntercept=0)
    expected = sample_values()[:4] * np.array([1, 0.25, 0.25, 0.25])[:, None, None]
    assert_holds(tmp_path, expected)


@pytest.mark.parametrize(
    ("orientation", "axes", "flips"),
    [((1, 0, 0, 0, 0, -1), (1, 0, 2), (1, -1, 1)), ((0, 1, 0, 0, 0, -1), (1, 2, 0), (-1, 1, -1))],
    ids=["coronal", "sagittal"],
)
def test_directions_are_honoured(tmp_path, orientation, axes, flips):
    """Rows, columns and slices become the axes of space: left, posterior, superior."""
    write_series(tmp_path, sample_values(), orientation=orientation)
    source = open_source(tmp_path)
    steps = np.array([2.5, 2, 0.5])[list(axes)]  # of [Z, Y, X] as stored
    assert source.spacing == tuple(steps[::-1])
    directions = np.array([*np.reshape(orientation, (2, 3)), np.cross(orientation[:3], orientation[3:])])
    stored = source.slices(0, source.dims[2])
    corner = np.full(3, 10.0)
    for z, y, x in [(0, 0, 0), (3, 4, 5), (10, 11, 12)]:
        place = corner + np.array([0.5 * x, 2 * y, 2.5 * z]) @ directions
        i, j, k = np.round((place - source.origin) / source.spacing).astype(int)
        assert stored[k, j, i] == sample_values()[z, y, x]


def test_one_of_several_series_is_chosen(tmp_path):
    other = generate_uid()
    write_series(tmp_path, sample_values())
    write_series(tmp_path, sample_values()[:4] + 1, uid=other, number=5)
    with pytest.raises(ArgumentError, match=r"got several series; choose one by dataset\.volume\.ser") as e:
        open_source(tmp_path)
    assert all(text in str(e.value) for text in (SERIES, other, "3 (Bone, 11 files", "5 (Bone, 4 files"))
    for choice in ("5", other):
        np.testing.assert_array_equal(whole(tmp_path, series=choice), sample_values()[:4] + 1)
    with pytest.raises(ArgumentError, match="got 0 series for '7'"):
        open_source(tmp_path, series="7")
    write_series(tmp_path, sample_values()[:5] + 2, uid=generate_uid(), number=0)
    np.testing.assert_array_equal(whole(tmp_path, series="0"), sample_values()[:5] + 2)


def write_steps(folder, tags):
    """Three volumes in one folder and series; tags are functions of step and slice."""
    for step in (2, 0, 1):
        of_slices = {name: partial(value, step) for name, value in tags.items()}
        write_series(folder, sample_values() + 100 * step, number=step, **of_slices)


@pytest.mark.parametrize(
    "tags",
    [
        {"TemporalPositionIdentifier": lambda step, z: step + 9, "AcquisitionNumber": lambda step, z: -step},
        {"TriggerTime": lambda step, z: 8.5 * step + 0.1 * (z % 3)},
        {"TriggerTime": lambda step, z: 0, "AcquisitionNumber": lambda step, z: 11 * step + z},
    ],
    ids=["position", "trigger", "acquisition"],
)
def test_volumes_of_one_series_are_steps_in_time(tmp_path, tags):
    """The first tag counts that differs at each place; neither hearts nor counters are even."""
    write_steps(tmp_path, tags)
    for step in range(3):
        source = open_source(tmp_path, time=step)
        assert (source.n_steps, source.spacing) == (3, (0.5, 2, 2.5))
        np.testing.assert_array_equal(source.slices(0, 11), sample_values() + 100 * step)
    assert open_source(tmp_path).note == "step 0 of 3; dataset.volume.time chooses another"
    with pytest.raises(ArgumentError, match=r"dataset\.volume\.time: expected one of 0 to 2, got 3$"):
        open_source(tmp_path, time=3)


def test_compressed_slices_are_read(tmp_path):
    write_series(tmp_path, sample_values())
    for path in tmp_path.iterdir():
        data = pydicom.dcmread(path)
        data.compress(RLELossless)
        data.save_as(path)
    assert_holds(tmp_path, sample_values())


def test_slices_that_cannot_be_decoded_are_refused(tmp_path, capfd):
    write_series(tmp_path, sample_values())
    for path in tmp_path.iterdir():
        data = pydicom.dcmread(path)
        data.file_meta.TransferSyntaxUID = JPEG2000Lossless
        data.PixelData = pydicom.encaps.encapsulate([b"no such stream"])
        data["PixelData"].is_undefined_length = True
        data.save_as(path)
    with pytest.raises(ArgumentError):
        open_source(tmp_path)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("which", [0, 1, -1])
def test_a_slice_that_is_cut_off_is_refused(tmp_path, which):
    write_series(tmp_path, sample_values())
    path = sorted(tmp_path.iterdir())[which]
    path.write_bytes(path.read_bytes()[:-100])
    with pytest.raises(ArgumentError, match=f"{path.name}: cut off, damaged"):
        open_source(tmp_path)


def test_a_file_that_is_none_of_dicom_but_has_its_ending_is_refused(tmp_path):
    write_series(tmp_path, sample_values())
    for name in ("DICOMDIR", "notes.txt", "._05-3.dcm"):
        (tmp_path / name).write_text("no slice")
    assert open_source(tmp_path).dims == (13, 12, 11)
    (tmp_path / "05-3.DCM").write_text("no slice")
    with pytest.raises(
        ArgumentError, match=r"05-3.DCM: cut off, damaged or no file of DICOM; put it there again"
    ):
        open_source(tmp_path)


def write_phases(folder, tags, n_steps=3, first=4):
    """A series for each phase; tags are functions of its step. Their numbers begin with the last step."""
    for step in range(n_steps):
        values, number = sample_values()[:5] + 100 * step, first + n_steps - step
        said = {name: value(step) for name, value in tags.items()}
        write_series(folder, values, uid=generate_uid(), **{"number": number, **said})


def no_position(step):
    return 1


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
                "TemporalPositionIdentifier": no_position,
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
    write_series(tmp_path, sample_values()[:1], SeriesDescription="Scout", **scout)
    for step in range(3):
        source = open_source(tmp_path, series="all", time=step)
        assert (source.n_steps, source.spacing) == (3, (0.5, 2, 2.5))
        np.testing.assert_array_equal(source.slices(0, 5), sample_values()[:5] + 100 * step)
    left = f"left out, on other lattices: 2 (Scout, 1 files, UID {scout['uid']})"
    assert open_source(tmp_path, series="all").note.endswith(f"; steps are the 3 series {name}; {left}")
    with pytest.raises(ArgumentError, match=r"dataset\.volume\.time: expected one of 0 to 2, got 3$"):
        open_source(tmp_path, series="all", time=3)
    with pytest.raises(ArgumentError, match="or series=all for those alike, as steps in time, of "):
        open_source(tmp_path)


def test_one_series_alone_has_its_own_steps(tmp_path):
    write_steps(tmp_path, {"TemporalPositionIdentifier": lambda step, z: step})
    assert open_source(tmp_path, series="all", time=2).n_steps == 3
