"""Slices of DICOM, files or frames of one: what headers say of them.

By pydicom: GDCM knows neither frames that are no even stack, nor slopes that differ from frame to frame, nor
doses.
"""

from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pydicom
from pydicom.datadict import keyword_for_tag

from texgs.core.errors import ArgumentError, located

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
# Of files whose frames have no places of their own; vectors have a number for each frame.
OFFSETS, DISTANCE, ORDER = "GridFrameOffsetVector", "SpacingBetweenSlices", "SliceVector"
STEPS = ("TimeSlotVector", "TimeSliceVector")
AS_STORED = {PLACE: (0, 0, 0), ORIENTATION: (1, 0, 0, 0, 1, 0)}


class Slice(NamedTuple):
    """One file of a series, or one frame of it."""

    path: Path
    frame: int | None  # its index in a file of many
    sizes: tuple[int, int]  # samples of a row, and of a column
    spacing: tuple[float, float]
    place: np.ndarray  # [3] of the first sample, mm: to the left, the back and the head
    directions: np.ndarray  # [3, 3] in rows: along a row of samples, along a column, and from slice to slice
    times: tuple[str, ...]  # what it says for `TIMES`
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
    said = said_in([*(data.get("DetectorInformationSequence") or [])[:1], data, *first_items(shared[0])])
    with located(path.name), advised(count > 1):
        if groups:
            frames = [said | said_in(first_items(group)) for group in groups]
        else:
            frames = stacked(said, count) if count > 1 else [said]
        if len(frames) != count:
            raise ArgumentError(f"expected places of {count} frames, got {len(frames)}")
        if len(stacks := {str(each.get("StackID", "")) for each in frames}) > 1:
            raise ArgumentError(f"expected one stack of frames, got {', '.join(sorted(stacks))}")
        return [slice_of(path, each, k if count > 1 else None) for k, each in enumerate(frames)]


@contextmanager
def advised(has_frames: bool) -> Iterator[None]:
    """Say what to do about a file of many frames that cannot be read."""
    try:
        yield
    except ArgumentError as error:
        raise ArgumentError(
            f"{error}; convert this multi-frame file: dcm2niix" if has_frames else str(error)
        ) from error


def said_in(items: Iterable[Any]) -> dict[str, Any]:
    """Return what items say by keywords, those behind in place of those before, without sequences."""
    elements = (each for item in items for each in item if each.VR != "SQ")
    return {each.keyword: each.value for each in elements if each.value not in (None, "")}


def first_items(group: Iterable[Any]) -> list[Any]:
    """Return the first item of each sequence in a functional group."""
    return [item for each in group if each.VR == "SQ" for item in each.value[:1]]


def stacked(said: dict[str, Any], count: int) -> list[dict[str, Any]]:
    """Return what is said of frames without groups of their own: doses, and images of nuclear medicine."""
    names = [keyword_for_tag(int(each)) for each in np.ravel(said.get("FrameIncrementPointer", ()))]
    vectors = {name: np.ravel(said.get(name, ())) for name in names}
    others = vectors.keys() - {OFFSETS, ORDER, *STEPS}
    if OFFSETS in said:
        heights = np.ravel(said[OFFSETS]).astype(float)
        heights -= heights[0]
    elif DISTANCE in said and all(
        vectors[each].size == count and not np.ptp(vectors[each]) for each in others
    ):
        heights = (vectors.get(ORDER, np.arange(1, count + 1)) - 1) * float(said[DISTANCE])
    else:
        ways = ", ".join(sorted(others)) or "nothing"
        raise ArgumentError(f"expected places of {count} frames, got {ways}, which tells none")
    if not AS_STORED.keys() <= said.keys():
        note = "DICOM tells no place and orientation of frames: they are taken as stored"
        said = {"note": note, **AS_STORED, **said}
    row, column = np.reshape(said[ORIENTATION], (2, 3)).astype(float)
    places = np.ravel(said[PLACE]).astype(float) + np.outer(heights, np.cross(row, column))
    steps = next((vectors[each] for each in STEPS if each in vectors), np.zeros(count, int))
    moments = ({} if steps.size != count else {"TemporalPositionIndex": each} for each in steps)
    return [said | {PLACE: place} | moment for place, moment in zip(places, moments, strict=True)]


def slice_of(path: Path, said: dict[str, Any], frame: int | None) -> Slice:
    """Return a slice by what is said of it."""
    place, axes = (np.ravel(said.get(name, ())).astype(float) for name in (PLACE, ORIENTATION))
    if (place.size, axes.size) != (3, 6):
        raise ArgumentError("expected a slice with its position and orientation, found none")
    row, column = np.reshape(axes, (2, 3))
    directions = np.stack([row, column, np.cross(row, column)])
    if not np.allclose(directions @ directions.T, np.eye(3), atol=1e-3):
        raise ArgumentError(f"expected rows and columns at right angles, got {axes.tolist()}")
    note, key = str(said.get("note", "")), next((each for each in SPACINGS if each in said), "")
    if key != SPACINGS[0]:
        taken = f"{key} is taken" if key else "samples of a slice are 1 apart"
        note = f"DICOM tells no {SPACINGS[0]}, so that {taken}; dataset.volume.spacing sets it"
    dy, dx = (float(number) for number in said.get(key, (1, 1)))
    bits, is_signed = int(said.get("BitsStored", 16)), bool(said.get("PixelRepresentation"))
    codes = [int(said[each]) % 2**bits for each in PADDING if each in said]  # with a sign or without
    codes = [code - 2**bits * (is_signed and code >> bits - 1) for code in codes]
    return Slice(
        path,
        frame,
        (int(said["Columns"]), int(said["Rows"])),
        (dx, dy),
        place,
        directions,
        tuple(str(next((said[each] for each in words if each in said), "")) for words in TIMES.values()),
        (
            float(said.get("RescaleSlope", said.get("DoseGridScaling", 1))),
            float(said.get("RescaleIntercept", 0)),
        ),
        (min(codes), max(codes)) if codes else None,
        note,
    )
