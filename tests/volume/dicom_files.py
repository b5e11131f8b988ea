"""Slices, series and files of many frames of DICOM, as pydicom writes them."""

from functools import partial

import numpy as np
import pydicom
from pydicom.uid import (
    CTImageStorage,
    EnhancedCTImageStorage,
    ExplicitVRLittleEndian,
    NuclearMedicineImageStorage,
    generate_uid,
)

from tests.volume.volume_files import sample_values

FRAMES = sample_values()[:5]  # [5, 12, 13]
AXIAL = (1, 0, 0, 0, 1, 0)
SERIES = generate_uid()
NORMAL = np.array([0.0, 0.6, 0.8])  # of a plane that is turned around x
TURNED = (1, 0, 0, 0, 0.8, -0.6)
VECTORS = {"SliceVector": 0x00540080, "EnergyWindowVector": 0x00540010}


def new_file(values, storage=EnhancedCTImageStorage, **tags):
    """Return a data set with a slice [Y, X] or frames [Z, Y, X] of 16 bits, and tags by their keywords."""
    data = pydicom.Dataset()
    data.file_meta = pydicom.dataset.FileMetaDataset()
    data.file_meta.TransferSyntaxUID = ExplicitVRLittleEndian
    data.file_meta.MediaStorageSOPClassUID = data.SOPClassUID = storage
    data.file_meta.MediaStorageSOPInstanceUID = data.SOPInstanceUID = generate_uid()
    data.SeriesInstanceUID, data.SeriesNumber, data.Modality = generate_uid(), 8, "CT"
    if values is not None:
        *n_frames, data.Rows, data.Columns = values.shape
        data.NumberOfFrames = n_frames[0] if n_frames else 1
        data.SamplesPerPixel, data.PhotometricInterpretation = 1, "MONOCHROME2"
        data.BitsAllocated = data.BitsStored = 16
        data.HighBit, data.PixelRepresentation = 15, int(values.dtype.kind == "i")
        data.PixelData = values.tobytes()
    for name, value in tags.items():
        setattr(data, name, value)
    return data


def save(path, values, storage=EnhancedCTImageStorage, **tags):
    """Write a new file."""
    new_file(values, storage, **tags).save_as(path, enforce_file_format=True)
    return path


def change(path, edit):
    """Edit a file, or all files of a folder."""
    for each in sorted(path.iterdir()) if path.is_dir() else [path]:
        data = pydicom.dcmread(each)
        edit(data)
        data.save_as(each)


def write_series(folder, values, places=None, uid=SERIES, number=3, orientation=AXIAL, **tags):
    """Write slices [Z, Y, X] as files whose names say nothing about their order.

    Tags are values, or functions of the number of a slice.
    """
    normal = np.cross(orientation[:3], orientation[3:])
    places = [10 + 2.5 * z * normal for z in range(len(values))] if places is None else places
    for z, (plane, place) in enumerate(zip(values, places, strict=True)):
        said = {"SeriesInstanceUID": uid, "SeriesNumber": number, "SeriesDescription": "Bone"}
        said |= {"InstanceNumber": z + 1, "PixelSpacing": [2.0, 0.5]}  # of rows, and of samples in a row
        said |= {"ImagePositionPatient": [*map(float, place)], "ImageOrientationPatient": list(orientation)}
        said |= {name: value(z) if callable(value) else value for name, value in tags.items()}
        save(folder / f"{(29 * z) % 101:02}-{number}.ima", plane.astype("<u2"), CTImageStorage, **said)


def write_steps(folder, tags):
    """Write three volumes into one folder and series; tags are functions of step and slice."""
    for step in (2, 0, 1):
        of_slices = {name: partial(value, step) for name, value in tags.items()}
        write_series(folder, sample_values() + 100 * step, number=step, **of_slices)


def write_phases(folder, tags, n_steps=3, first=4):
    """Write a series for each phase; tags are functions of its step. Numbers begin with the last step."""
    for step in range(n_steps):
        said = {"number": first + n_steps - step} | {name: value(step) for name, value in tags.items()}
        write_series(folder, FRAMES + 100 * step, uid=generate_uid(), **said)


def group(**sequences):
    """Return a functional group: the only item of each sequence."""
    made = pydicom.Dataset()
    for name, words in sequences.items():
        item = pydicom.Dataset()
        for keyword, value in words.items():
            setattr(item, keyword, value)
        setattr(made, name, [item])
    return made


def frame(z, slope=1.0, intercept=0.0, content=None):
    """Return the functional groups of a frame."""
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
    groups = {"SharedFunctionalGroupsSequence": [shared], "PerFrameFunctionalGroupsSequence": frames}
    return save(path, values, **groups, **tags)


def write_nuclear(path, values=FRAMES, **tags):
    """Write frames of nuclear medicine, which vectors among the tags count."""
    known = {"PixelSpacing": [2.0, 0.5], "SpacingBetweenSlices": 2.5}
    if pointers := [VECTORS[name] for name in tags if name in VECTORS]:
        known["FrameIncrementPointer"] = pointers
    return save(path, values, NuclearMedicineImageStorage, **known | tags)
