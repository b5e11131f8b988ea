"""Slices of DICOM, files or frames of one: the facts in their headers.

By pydicom: GDCM knows neither frames that are no even stack, nor slopes that differ from frame to frame, nor
doses.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pydicom
from pydicom.datadict import keyword_for_tag

from texgs.core.errors import ArgumentError, errors_at

# What orders slices at one place, in files of one slice and of many: the first whose values differ there.
TIMES = {
    "temporal position": ("TemporalPositionIdentifier", "TemporalPositionIndex"),
    "trigger time": ("TriggerTime", "NominalCardiacTriggerDelayTime"),
    "acquisition number": ("AcquisitionNumber", "FrameAcquisitionNumber"),
}
# The first that is there counts: at the patient, at the detector, and one that is only meant.
SPACINGS = ("PixelSpacing", "ImagerPixelSpacing", "NominalScannedPixelSpacing")
PLACE, ORIENTATION = "ImagePositionPatient", "ImageOrientationPatient"
PADDING = ("PixelPaddingValue", "PixelPaddingRangeLimit")
# Of files whose frames have no places of their own.
OFFSETS, DISTANCE, ORDER = "GridFrameOffsetVector", "SpacingBetweenSlices", "SliceVector"
AS_STORED = {PLACE: (0, 0, 0), ORIENTATION: (1, 0, 0, 0, 1, 0)}
CONVERT_ADVICE = "convert it: dcm2niix"  # advice for frames or slices without even spacing


class Slice(NamedTuple):
    """One file of a series, or one frame of it."""

    path: Path
    frame: int | None  # its index in a file of many
    sizes: tuple[int, int]  # samples of a row, and of a column
    spacing: tuple[float, float]
    place: np.ndarray  # [3] of the first sample, mm: to the left, the back and the head
    directions: np.ndarray  # [3, 3] in rows: along a row of samples, along a column, and from slice to slice
    times: tuple[str, ...]  # its values for `TIMES`
    scale: tuple[float, float]  # slope and intercept
    padding: tuple[int, int] | None  # the range of stored samples that stand for none
    note: str  # for the user

    @property
    def name(self) -> str:
        """What messages call it."""
        return self.path.name if self.frame is None else f"frame {self.frame} of {self.path.name}"

    @property
    def height(self) -> float:
        """Where the slice is along the normal of its plane."""
        return float(self.place @ self.directions[2])


def slices_in(path: Path) -> list[Slice]:
    """Return the slices of a file: one, or its frames."""
    pydicom.config.settings.reading_validation_mode = pydicom.config.IGNORE
    data = pydicom.dcmread(path, stop_before_pixels=True, force=True)
    count, groups = int(data.get("NumberOfFrames") or 1), data.get("PerFrameFunctionalGroupsSequence") or []
    shared = data.get("SharedFunctionalGroupsSequence") or [()]
    said = values_in([*(data.get("DetectorInformationSequence") or [])[:1], data, *first_items(shared[0])])
    with errors_at(path.name if count < 2 else f"{path.name}, a multi-frame file"):
        frames = [said | values_in(first_items(group)) for group in groups] or [said]
        if count > 1 and not groups:
            frames = place_frames(said, count)
        if len(frames) != count:
            raise ArgumentError(f"expected places of {count} frames, got {len(frames)}; {CONVERT_ADVICE}")
        if len(stacks := {str(each.get("StackID", "")) for each in frames}) > 1:
            raise ArgumentError(
                f"expected one stack of frames, got {', '.join(sorted(stacks))}; {CONVERT_ADVICE}"
            )
        return [slice_of(path, each, k if count > 1 else None) for k, each in enumerate(frames)]


def values_in(items: Iterable[Any]) -> dict[str, Any]:
    """Return what items say by keywords, those behind in place of those before, without sequences."""
    elements = (each for item in items for each in item if each.VR != "SQ")
    return {each.keyword: each.value for each in elements if each.value not in (None, "")}


def first_items(group: Iterable[Any]) -> list[Any]:
    """Return the first item of each sequence in a functional group."""
    return [item for each in group if each.VR == "SQ" for item in each.value[:1]]


def place_frames(said: dict[str, Any], count: int) -> list[dict[str, Any]]:
    """Return facts about frames without own groups: doses, and slices of nuclear medicine."""
    pointers = {keyword_for_tag(int(each)) for each in np.ravel(said.get("FrameIncrementPointer", ()))}
    if OFFSETS in said:
        heights = np.ravel(said[OFFSETS]).astype(float)
    elif DISTANCE in said and pointers <= {ORDER}:
        heights = np.ravel(said.get(ORDER, range(count))) * float(said[DISTANCE])
    else:
        ways = ", ".join(sorted(pointers)) or "nothing"
        raise ArgumentError(
            f"expected places of {count} frames, got {ways}, which tells none; {CONVERT_ADVICE}"
        )
    if not AS_STORED.keys() <= said.keys():
        note = "DICOM tells no place and orientation of frames: they are taken as stored"
        said = {"note": note, **AS_STORED, **said}
    normal = np.cross(*np.reshape(said[ORIENTATION], (2, 3)).astype(float))
    places = np.ravel(said[PLACE]).astype(float) + np.outer(heights - heights[0], normal)
    return [said | {PLACE: place} for place in places]


def slice_of(path: Path, said: dict[str, Any], frame: int | None) -> Slice:
    """Make a slice from facts about it."""
    place, axes = (np.ravel(said.get(name, ())).astype(float) for name in (PLACE, ORIENTATION))
    if (place.size, axes.size) != (3, 6):
        raise ArgumentError(
            f"expected a slice with its position and orientation, found none; {CONVERT_ADVICE}"
        )
    row, column = np.reshape(axes, (2, 3))
    directions = np.stack([row, column, np.cross(row, column)])
    if not np.allclose(directions @ directions.T, np.eye(3), atol=1e-3):
        raise ArgumentError(
            f"expected rows and columns at right angles, got {axes.tolist()}; {CONVERT_ADVICE}"
        )
    note, key = str(said.get("note", "")), next((each for each in SPACINGS if each in said), "")
    if key != SPACINGS[0]:
        taken = f"{key} is taken" if key else "samples of a slice are 1 apart"
        note = f"DICOM tells no {SPACINGS[0]}, so that {taken}; dataset.volume.spacing sets it"
    dy, dx = (float(number) for number in said.get(key, (1, 1)))
    sizes = (int(said["Columns"]), int(said["Rows"]))
    times = tuple(str(next((said[each] for each in words if each in said), "")) for words in TIMES.values())
    slope = float(said.get("RescaleSlope", said.get("DoseGridScaling", 1)))
    scale = (slope, float(said.get("RescaleIntercept", 0)))
    bits, is_signed = int(said.get("BitsStored", 16)), bool(said.get("PixelRepresentation"))
    codes = [int(said[each]) % 2**bits for each in PADDING if each in said]  # with a sign or without
    codes = [code - 2**bits * (is_signed and code >> bits - 1) for code in codes]
    padding = (min(codes), max(codes)) if codes else None
    return Slice(path, frame, sizes, (dx, dy), place, directions, times, scale, padding, note)
