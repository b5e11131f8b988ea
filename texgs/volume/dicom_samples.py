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


def samples_of(slices: Sequence[Slice]) -> np.ndarray:
    """Return samples [Z, Y, X] of slices, rescaled by slope and intercept."""
    require_room((*slices[0].sizes, len(slices)), np.dtype(np.float32))
    if any(each.frame is not None for each in slices):
        return samples_of_frames(slices)
    return np.concatenate([sitk.GetArrayFromImage(sitk.ReadImage(each.path)) for each in slices])


def samples_of_frames(slices: Sequence[Slice]) -> np.ndarray:
    """Return samples [Z, Y, X] of frames; whole numbers that fit into 16 bits stay such."""
    stored = {path: stored_frames(path) for path in {each.path for each in slices}}
    planes = [stored[each.path][each.frame or 0] for each in slices]
    scales = [each.scale for each in slices]
    if {*scales} == {(1, 0)}:
        return np.stack(planes)
    values = np.stack([plane * a + b for plane, (a, b) in zip(planes, scales, strict=True)], dtype=np.float32)
    with np.errstate(invalid="ignore"):
        whole = values.astype(np.int16)
    return whole if np.array_equal(whole, values) else values


def stored_frames(path: Path) -> np.ndarray:
    """Return samples [frames, Y, X] of a file as they are stored."""
    data = pydicom.dcmread(path, force=True)
    if not data.file_meta.TransferSyntaxUID.is_encapsulated:
        return data.pixel_array.reshape(-1, data.Rows, data.Columns)
    # GDCM unpacks more than pydicom, but would rescale all frames as the first.
    bare = data.group_dataset(0x0028)
    bare.RescaleSlope, bare.RescaleIntercept = 1, 0
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
    one, least = values[masks][0], values.min(where=~masks, initial=values.max())
    values[masks] = least
    share = f"{100 * count / values.size:.3g} %"
    return f"{share} of the samples are padding ({one:g}) and take the smallest other value, {least:g}"
