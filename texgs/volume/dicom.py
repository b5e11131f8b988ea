"""Folders of DICOM slices, as lattice and samples.

Which series, which of its steps in time, and whether their slices are a lattice.
"""

import tempfile
from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pydicom
import SimpleITK as sitk
from pydicom.uid import MultiFrameGrayscaleWordSecondaryCaptureImageStorage as CAPTURE

from texgs.core.errors import ArgumentError
from texgs.volume.axes import Axis, place_on
from texgs.volume.dicom_series import ALL, FileSeries, choose_series, phases_of, series_in
from texgs.volume.dicom_slice import CONVERT_ADVICE, TIMES, Slice, slices_in
from texgs.volume.grid import dims_of, require_room
from texgs.volume.itk_image import sentence
from texgs.volume.space import LPS

GAP_TOLERANCE = 0.05  # tolerance in slice distances, as files round positions
TILT_TOLERANCE = 0.01  # sideways tolerance, relative to the distance to the first slice
ROUNDING = 0.01  # mm, and share of the widest gap; closer slices share a position


def read_dicom(path: Path, series: str | None, time: int) -> tuple[dict[str, Any], np.ndarray]:
    """Read lattice and samples [Z, Y, X], rescaled by slope and intercept, of a step of a series."""
    sitk.ProcessObject.GlobalWarningDisplayOff()
    try:
        slices, n_steps, note = step_at(path, series, time)
        distance = slice_distance(slices)
        values = samples_of(slices)
    except RuntimeError as error:
        raise ArgumentError(sentence(error)) from error
    first = slices[0]
    lattice = {
        "dims": dims_of(values.shape),
        "dtype": values.dtype.name,
        "spacing": (*first.spacing, distance),
        "origin": first.place.tolist(),
        "directions": first.directions.tolist(),
        "space": LPS,
        "unit": "mm",
        "n_steps": n_steps,
        "note": "; ".join(filter(None, (note, first.note, replace_padding(values, slices)))),
    }
    return lattice, values


def step_at(path: Path, series: str | None, time: int) -> tuple[list[Slice], int, str]:
    """Return the slices of a step, the number of steps, and a note about them."""
    every = series_in(path) if path.is_dir() else [FileSeries([str(path)])]
    if series == ALL and len(every) > 1:
        phases, note = phases_of(every)
        return slices_of(phases[place_on(Axis("time", len(phases)), time)]), len(phases), note
    steps = steps_of(slices_of(choose_series(every, series)))
    return steps[place_on(Axis("time", len(steps)), time)], len(steps), ""


def slices_of(series: FileSeries) -> list[Slice]:
    """Return the slices of a series, sorted by height."""
    slices = [each for file in series.files for each in slices_in(Path(file))]
    return sorted(slices, key=lambda each: each.height)


def steps_of(slices: list[Slice]) -> list[list[Slice]]:
    """Return the slices of each step of time, from slices sorted by height; those at one place are its steps.

    Heartbeats differ, so that it is the order of trigger times that counts, not their values.
    """
    gaps = np.diff([each.height for each in slices])
    cuts = [k for k, gap in enumerate(gaps, start=1) if gap > ROUNDING * gaps.max()]
    places = [slices[start:stop] for start, stop in pairwise([0, *cuts, len(slices)])]
    if len(places) == len(slices):
        return [slices]
    index, name = time_tag(places)
    first = places[0]
    if odd := next((place for place in places if len(place) != len(first)), None):
        raise ArgumentError(
            f"expected a slice of each {name} at each place, got {len(first)} at {first[0].height:.6g} mm, "
            f"{len(odd)} at {odd[0].height:.6g} mm; complete the series"
        )
    in_order = [sorted(place, key=lambda each: float(each.times[index])) for place in places]
    return [list(step) for step in zip(*in_order, strict=True)]


def time_tag(places: list[list[Slice]]) -> tuple[int, str]:
    """Return index and name of the tag that distinguishes all slices at one position."""
    for index, name in enumerate(TIMES):
        values = [[each.times[index] for each in place] for place in places]
        if all("" not in some and len({*map(float, some)}) == len(some) for some in values):
            return index, name
    first, second = next(place for place in places if len(place) > 1)[:2]
    raise ArgumentError(
        f"{first.name} and {second.name}: expected slices at different places, got two at one, and "
        f"no {' or '.join(TIMES)} in all that tells such slices apart; {CONVERT_ADVICE}"
    )


def slice_distance(slices: list[Slice]) -> float:
    """Return the distance from slice to slice, in mm, of a series in the order of its places."""
    first = slices[0]
    if len(slices) < 2:
        raise ArgumentError("expected at least 2 slices, got 1; open the folder with all of the series")
    for each in slices:
        is_like = each.sizes == first.sizes and np.allclose(each.spacing, first.spacing)
        if not is_like or not np.allclose(each.directions, first.directions, atol=1e-3):
            raise ArgumentError(
                f"{each.name}: expected size, spacing and orientation of {first.name}; {CONVERT_ADVICE}"
            )
        shift = np.abs(first.directions[:2] @ (each.place - first.place)).max()
        if shift > TILT_TOLERANCE * (each.height - first.height) + ROUNDING:
            raise ArgumentError(
                f"{each.name}: expected slices behind each other, got one {shift:.3g} mm "
                f"beside {first.name}; correct the tilt of the gantry first"
            )
    gaps = np.diff([each.height for each in slices])
    step = float(np.sort(gaps)[(len(gaps) - 1) // 2])
    worst = int(np.abs(gaps - step).argmax())
    if abs(gaps[worst] - step) > GAP_TOLERANCE * step:
        raise ArgumentError(
            f"{slices[worst].name} and {slices[worst + 1].name}: expected slices {step:.6g} mm apart, got "
            f"{gaps[worst]:.6g} mm; complete the series, or {CONVERT_ADVICE}"
        )
    return float(slices[-1].height - first.height) / len(gaps)


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
    """Return stored samples [frames, Y, X] of a file."""
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


def replace_padding(values: np.ndarray, slices: Sequence[Slice]) -> str:
    """Set padding to the smallest value of all other samples, in place; return a note for the user."""
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
