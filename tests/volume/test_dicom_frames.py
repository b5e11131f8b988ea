"""Files of DICOM with many frames, and what stands for no sample, as pydicom writes them."""

from itertools import product

import numpy as np
import pydicom
import pytest
import SimpleITK as sitk
from pydicom.encaps import encapsulate, generate_frames
from pydicom.uid import (
    EnhancedCTImageStorage,
    ExplicitVRLittleEndian,
    NuclearMedicineImageStorage,
    RTDoseStorage,
    RTStructureSetStorage,
    generate_uid,
)

from tests.volume.test_dicom import AXIAL, write_series
from tests.volume.volume_files import assert_holds, sample_values, whole
from texgs.core.errors import ArgumentError
from texgs.volume.sources import open_source

VALUES = sample_values()[:5]
NORMAL = np.array([0.0, 0.6, 0.8])  # of a plane that is turned around x
TURNED = (1, 0, 0, 0, 0.8, -0.6)
VECTORS = {"SliceVector": 0x00540080, "EnergyWindowVector": 0x00540010}


def new_file(values, storage=EnhancedCTImageStorage, **tags):
    data = pydicom.Dataset()
    data.file_meta = pydicom.dataset.FileMetaDataset()
    data.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    data.file_meta.MediaStorageSOPClassUID = data.SOPClassUID = storage
    data.file_meta.MediaStorageSOPInstanceUID = data.SOPInstanceUID = generate_uid()
    data.SeriesInstanceUID, data.SeriesNumber, data.Modality = generate_uid(), 8, "CT"
    if values is not None:
        data.NumberOfFrames, data.Rows, data.Columns = values.shape
        data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
        data.BitsAllocated = data.BitsStored = 16
        data.HighBit, data.PixelRepresentation = 15, int(values.dtype.kind == "i")
        data.PixelData = values.tobytes()
    for name, value in tags.items():
        setattr(data, name, value)
    return data


def group(**sequences):
    """A functional group: the only item of each sequence."""
    made = pydicom.Dataset()
    for name, words in sequences.items():
        item = pydicom.Dataset()
        for keyword, value in words.items():
            setattr(item, keyword, value)
        setattr(made, name, [item])
    return made


def frame(z, slope=1.0, intercept=0.0, content=None):
    place = (np.array([10, 20, 30]) + 2.5 * z * NORMAL).tolist()
    return group(
        PlanePositionSequence={"ImagePositionPatient": place},
        PixelValueTransformationSequence={"RescaleSlope": slope, "RescaleIntercept": intercept},
        FrameContentSequence=content or {"StackID": "1"},
    )


def write_enhanced(path, values, frames, **tags):
    """Write frames that share spacing and orientation."""
    shared = group(
        PixelMeasuresSequence={"PixelSpacing": [2.0, 0.5]},
        PlaneOrientationSequence={"ImageOrientationPatient": list(TURNED)},
    )
    data = new_file(values, **tags)
    data.SharedFunctionalGroupsSequence, data.PerFrameFunctionalGroupsSequence = [shared], frames
    data.save_as(path, enforce_file_format=True)
    return path


@pytest.mark.parametrize("in_folder", [False, True])
def test_frames_in_any_order_have_their_place_and_their_own_slope(tmp_path, in_folder):
    order = [3, 0, 4, 1, 2]
    path = write_enhanced(tmp_path / "e.dcm", VALUES[order], [frame(z, 0.5 + z, -z) for z in order])
    source = open_source(tmp_path if in_folder else path)
    assert (source.spacing, source.n_steps, source.note) == ((0.5, 2, 2.5), 1, "")
    slopes, intercepts = (np.reshape(numbers, (5, 1, 1)) for numbers in (0.5 + np.arange(5), -np.arange(5)))
    np.testing.assert_allclose(source.slices(0, 5), VALUES * slopes + intercepts)


def test_whole_numbers_stay_such(tmp_path):
    path = write_enhanced(tmp_path / "e.dcm", VALUES, [frame(z, 1, -1024) for z in range(5)])
    assert open_source(path).dtype == np.int16
    np.testing.assert_array_equal(whole(path), VALUES.astype(int) - 1024)


@pytest.mark.parametrize("kind", ["RLE", "JPEG", "JPEG2000"])
def test_frames_that_are_compressed(tmp_path, kind):
    """SimpleITK compresses slices; their streams are frames of one file."""
    path = write_enhanced(tmp_path / "e.dcm", VALUES, [frame(z, 2, z) for z in range(5)])
    data = pydicom.dcmread(path)
    if kind == "RLE":
        data.compress(pydicom.uid.RLELossless)
    else:
        streams = []
        for plane in VALUES:
            writer = sitk.ImageFileWriter()
            writer.SetUseCompression(True)
            writer.SetCompressor(kind)
            writer.SetFileName(str(tmp_path / "one.dcm"))
            writer.Execute(sitk.GetImageFromArray(plane))
            one = pydicom.dcmread(tmp_path / "one.dcm")
            streams.append(next(generate_frames(one.PixelData, number_of_frames=1)))
        data.PixelData, data.file_meta.TransferSyntaxUID = (
            encapsulate(streams),
            one.file_meta.TransferSyntaxUID,
        )
        data["PixelData"].is_undefined_length = True
    data.RescaleSlope = 7  # that of the whole file does not count
    data.save_as(path)
    np.testing.assert_array_equal(whole(path), 2 * VALUES + np.arange(5)[:, None, None])


def test_steps_in_time_of_frames(tmp_path):
    frames = [
        frame(z, content={"TemporalPositionIndex": 9 + t, "StackID": "1"})
        for z, t in product(range(5), range(2))
    ]
    values = np.stack([VALUES, VALUES + 100], axis=1).reshape(10, *VALUES.shape[1:])
    path = write_enhanced(tmp_path / "e.dcm", values, frames)
    for step in range(2):
        assert open_source(path, time=step).note.startswith(f"step {step} of 2")
        np.testing.assert_array_equal(whole(path, time=step), VALUES + 100 * step)
    with pytest.raises(ArgumentError, match=r"dataset\.volume\.time: expected one of 0 to 1, got 2$"):
        open_source(path, time=2)


PLANE = {
    "ImagePositionPatient": [1, 2, 3],
    "ImageOrientationPatient": list(AXIAL),
    "PixelSpacing": [2.0, 0.5],
}


@pytest.mark.parametrize("first", [0.0, 3.0])
def test_a_dose_has_its_unit(tmp_path, first):
    """Offsets of frames are distances, or places along z."""
    offsets = [first + 2.5 * z for z in range(5)]
    dose = {"GridFrameOffsetVector": offsets, "FrameIncrementPointer": 0x3004000C, "DoseGridScaling": 0.01}
    data = new_file(VALUES, RTDoseStorage, **PLANE, **dose)
    data.save_as(tmp_path / "d.dcm", enforce_file_format=True)
    source = open_source(tmp_path / "d.dcm")
    assert (source.spacing, source.origin) == ((0.5, 2, 2.5), (1, 2, 3))
    np.testing.assert_allclose(source.slices(0, 5), VALUES * 0.01, rtol=1e-6)


def nuclear(path, values=VALUES, **tags):
    pointers = [VECTORS[name] for name in tags if name in VECTORS]
    known = {"PixelSpacing": [2.0, 0.5], "SpacingBetweenSlices": 2.5} | (
        {"FrameIncrementPointer": pointers} if pointers else {}
    )
    data = new_file(values, NuclearMedicineImageStorage, **known | tags)
    data.save_as(path, enforce_file_format=True)
    return path


def test_slices_of_nuclear_medicine_are_counted(tmp_path):
    path = nuclear(tmp_path / "n.dcm")
    assert (
        open_source(path).note == "DICOM tells no place and orientation of frames: they are taken as stored"
    )
    assert_holds(path, VALUES, (0.5, 2, 2.5), (0, 0, 0))
    detector = pydicom.Dataset()
    detector.ImagePositionPatient, detector.ImageOrientationPatient = [1, 2, 3], list(AXIAL)
    nuclear(path, VALUES, DetectorInformationSequence=[detector], SliceVector=[1, 2, 3, 4, 5])
    assert open_source(path).note == ""
    assert_holds(path, VALUES, (0.5, 2, 2.5), (1, 2, 3))
    nuclear(path, VALUES, EnergyWindowVector=[1, 1, 1, 2, 2])
    with pytest.raises(ArgumentError, match="places of 5 frames, got EnergyWindowVector, which tells none"):
        open_source(path)


def test_other_objects_beside_slices_are_not_mixed_in(tmp_path):
    write_series(tmp_path, VALUES)
    new_file(None, RTStructureSetStorage).save_as(tmp_path / "s.dcm", enforce_file_format=True)
    assert_holds(tmp_path, VALUES)
    dose = {"GridFrameOffsetVector": list(range(5)), "DoseGridScaling": 2, "Modality": "RTDOSE"}
    data = new_file(VALUES, RTDoseStorage, **PLANE, **dose)
    data.save_as(tmp_path / "d.dcm", enforce_file_format=True)
    with pytest.raises(ArgumentError, match=r"got several series; .* 8 \(RTDOSE, 1 files"):
        open_source(tmp_path)
    assert_holds(tmp_path, VALUES, series="3")
    assert_holds(tmp_path, 2 * VALUES, series="8")


@pytest.mark.parametrize(
    ("stored", "told", "kind", "bits"),
    [(-2000, -2000, "SS", 16), (-2000, 63536, "US", 16), (63536, -2000, "SS", 16), (2096, 63536, "US", 12)],
    ids=["signed", "as unsigned", "of unsigned", "12 bits"],
)
@pytest.mark.parametrize("limit", [0, 3])
def test_padding_takes_the_smallest_value_of_the_rest(tmp_path, stored, told, kind, bits, limit):
    values = VALUES.astype(int) + 7
    values[:, :3] = stored
    values[:, 0] += limit
    tags = {"PixelRepresentation": int(stored < 0), "BitsStored": bits, "HighBit": bits - 1}
    write_series(tmp_path, values.astype("<i4").astype("<u2"), RescaleSlope=2, RescaleIntercept=-1, **tags)
    for path in tmp_path.iterdir():
        data = pydicom.dcmread(path)
        data.add_new(0x00280120, kind, told)
        if limit:
            data.add_new(0x00280121, kind, told + limit)
        data.save_as(path)
    expected = np.maximum(2 * values - 1, (2 * values[:, 3:] - 1).min())
    expected[:, :3] = expected[:, 3:].min()
    assert_holds(tmp_path, expected)
    least, code = expected.min(), 2 * (stored + limit) - 1
    note = f"25 % of the samples are padding ({code}) and take the smallest other value, {least}"
    assert open_source(tmp_path).note == note


def test_padding_of_frames(tmp_path):
    values = VALUES.astype("<i2") + 7
    values[:, :3] = -2000
    path = write_enhanced(tmp_path / "e.dcm", values, [frame(z, 1 + z) for z in range(5)])
    data = pydicom.dcmread(path)
    data.add_new(0x00280120, "SS", -2000)
    data.save_as(path)
    slopes = 1 + np.arange(5)[:, None, None]
    np.testing.assert_array_equal(whole(path)[:, 3:], (values * slopes)[:, 3:])
    assert (whole(path)[:, :3] == (values * slopes)[:, 3:].min()).all()


@pytest.mark.parametrize(
    ("keyword", "note"),
    [
        ("ImagerPixelSpacing", "so that ImagerPixelSpacing is taken; dataset"),
        ("NominalScannedPixelSpacing", "so that NominalScannedPixelSpacing is taken; dataset"),
        ("", "so that samples of a slice are 1 apart; dataset"),
    ],
)
def test_a_spacing_that_is_none_of_the_patient_is_told(tmp_path, keyword, note):
    write_series(tmp_path, VALUES, **({keyword: [3.0, 0.25]} if keyword else {}))
    for path in tmp_path.iterdir():
        data = pydicom.dcmread(path)
        del data.PixelSpacing
        data.save_as(path)
    source = open_source(tmp_path)
    assert source.note.startswith(f"DICOM tells no PixelSpacing, {note}")
    assert source.spacing == ((0.25, 3, 2.5) if keyword else (1, 1, 2.5))
