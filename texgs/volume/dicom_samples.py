"""Samples of DICOM slices, rescaled; those that stand for none become the smallest of the others."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pydicom
import SimpleITK as sitk
from pydicom.uid import MultiFrameGrayscaleWordSecondaryCaptureImageStorage as CAPTURE

from texgs.volume.dicom_slice import Slice
from texgs.volume.grid import require_room
from texgs.volume.itk_image import require_volume

SCALE = ("RescaleSlope", "RescaleIntercept")
INT16 = np.iinfo(np.int16)


def samples_of(slices: Sequence[Slice]) -> np.ndarray:
    """Return samples [Z, Y, X] of slices, rescaled by slope and intercept."""
    if any(each.frame is not None for each in slices):
        return samples_of_frames(slices)
    headers = [header(each.path) for each in slices]
    pixel_ids = {each.GetPixelIDValue() for each in headers}
    pixel_id = sitk.sitkFloat64 if len(pixel_ids) > 1 else pixel_ids.pop()
    require_room(
        *require_volume([*slices[0].sizes, len(slices)], pixel_id, headers[0].GetNumberOfComponents())
    )
    reader = sitk.ImageSeriesReader()
    reader.SetFileNames([str(each.path) for each in slices])
    reader.SetOutputPixelType(pixel_id)
    return sitk.GetArrayFromImage(reader.Execute())


def header(path: Path) -> sitk.ImageFileReader:
    """Return a reader that has read a header."""
    reader = sitk.ImageFileReader()
    reader.SetFileName(str(path))
    reader.ReadImageInformation()
    return reader


def samples_of_frames(slices: Sequence[Slice]) -> np.ndarray:
    """Return samples [Z, Y, X] of frames; whole numbers that fit into 16 bits stay such."""
    columns, rows = slices[0].sizes
    require_room((columns, rows, len(slices)), np.dtype(np.float32))
    stored = {path: stored_frames(path) for path in {each.path for each in slices}}
    is_scaled = any(each.scale != (1, 0) for each in slices)
    dtype = np.result_type(*stored.values())
    values = np.empty((len(slices), rows, columns), np.float32 if is_scaled else dtype)
    for plane, each in zip(values, slices, strict=True):
        slope, intercept = each.scale
        samples = stored[each.path][each.frame or 0]
        plane[:] = samples * slope + intercept if is_scaled else samples
    is_whole = dtype.kind in "iu" and all(float(x).is_integer() for each in slices for x in each.scale)
    fits = INT16.min <= values.min() and values.max() <= INT16.max
    return values.astype(np.int16) if is_scaled and is_whole and fits else values


def stored_frames(path: Path) -> np.ndarray:
    """Return samples [frames, Y, X] of a file as they are stored."""
    data = pydicom.dcmread(path, force=True)
    if not data.file_meta.TransferSyntaxUID.is_encapsulated:
        return data.pixel_array.reshape(-1, data.Rows, data.Columns)
    # GDCM unpacks more than pydicom, but would rescale all frames as the first.
    bare = data.group_dataset(0x0028)
    for name in SCALE:
        bare.pop(name, None)
    bare["PixelData"], bare.file_meta = data["PixelData"], data.file_meta
    bare.SOPInstanceUID, bare.SOPClassUID = data.SOPInstanceUID, CAPTURE
    with tempfile.TemporaryDirectory() as folder:
        bare.save_as(file := Path(folder) / "bare.dcm", enforce_file_format=True)
        return sitk.GetArrayFromImage(sitk.ReadImage(file))


def without_padding(values: np.ndarray, slices: Sequence[Slice]) -> str:
    """Let samples that stand for none take the smallest value of the others, and return what to say of it."""
    masks = np.zeros(values.shape, bool)
    for mask, plane, each in zip(masks, values, slices, strict=True):
        if each.padding:
            low, high = sorted(each.scale[0] * code + each.scale[1] for code in each.padding)
            half = abs(each.scale[0]) / 2  # of the distance of values: they are rounded
            mask[:] = (plane >= low - half) & (plane <= high + half)
    count = int(masks.sum())
    if count in (0, values.size):
        return ""
    one = values[masks][0]
    least = values.min(where=~masks, initial=values.max())
    values[masks] = least
    share = f"{100 * count / values.size:.3g} %"
    return f"{share} of the samples are padding ({one:g}) and take the smallest other value, {least:g}"
