"""Folders of DICOM slices, as lattice and samples.

Which series, which of its steps in time, and whether their slices are a lattice.
"""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pydicom
import SimpleITK as sitk

from texgs.core.errors import ArgumentError
from texgs.volume.dicom_phases import ALL, FileSeries, phases_of
from texgs.volume.dicom_samples import samples_of, without_padding
from texgs.volume.dicom_slice import CONVERT, TIMES, Slice, said_in, slices_in
from texgs.volume.grid import dims_of
from texgs.volume.itk_image import sentence
from texgs.volume.slabs import require_step
from texgs.volume.space import LPS

OF_SERIES = ["SeriesNumber", "SeriesDescription", "TemporalPositionIdentifier", "Modality"]
UNEVEN = 0.05  # of the distance of slices: how much one may differ, as places are rounded in files
TILT = 0.01  # of the distance of the outer slices: how far one may be shifted across it
ROUNDING = 0.01  # mm; and of the widest gap: slices that are closer are at one place
MAGIC, PIXELS = b"DICM", b"\xe0\x7f\x10\x00"  # of a file with 128 bytes before it; the tag of its samples


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
        "note": "; ".join(filter(None, (note, first.note, without_padding(values, slices)))),
    }
    return lattice, values


def step_at(path: Path, series: str | None, time: int) -> tuple[list[Slice], int, str]:
    """Return the slices of a step, how many steps there are, and what to say of them."""
    every = series_in(path) if path.is_dir() else [FileSeries([str(path)])]
    if series == ALL and len(every) > 1:
        phases, note = phases_of(every)
        require_step(time, len(phases))
        return slices_of(phases[time]), len(phases), note
    steps = steps_of(slices_of(chosen(every, series)))
    require_step(time, len(steps))
    return steps[time], len(steps), ""


def series_in(folder: Path) -> list[FileSeries]:
    """Return all series of a folder, one at least; no slice may be damaged."""
    every, reader = [], sitk.ImageSeriesReader
    for uid in reader.GetGDCMSeriesIDs(str(folder)):
        files = reader.GetGDCMSeriesFileNames(str(folder), uid)
        header = pydicom.dcmread(files[0], stop_before_pixels=True, force=True, specific_tags=OF_SERIES)
        first = said_in([header])
        number, description, position, kind = (str(first.get(each, "")) for each in OF_SERIES)
        lattice = lattice_of(Path(files[0]), len(files))
        every.append(FileSeries(files, uid, number, description or kind, position, lattice))
    names = {Path(file).name for each in every for file in each.files}
    unlisted = [path for path in sorted(folder.iterdir()) if path.name not in names]
    if damaged := next(filter(is_damaged, unlisted), None):
        raise ArgumentError(
            f"{damaged.name}: cut off, damaged or no file of DICOM; put it there again, or take it away"
        )
    if not every:
        below = ", ".join([path.name for path in unlisted if path.is_dir()][:3])
        advice = f"; open the folder with the slices, in {below}" if below else ""
        raise ArgumentError(
            f"expected a folder of DICOM slices or TIFFs (.tif, .tiff), found none in it{advice}"
        )
    return every


def lattice_of(file: Path, count: int) -> tuple[float, ...]:
    """Return that of a series as `FileSeries` has it, rounded to 0.001 mm."""
    try:
        first, *others = slices_in(file)
    except (ArgumentError, KeyError):  # a report, say, that has no place
        return ()
    numbers = count * (1 + len(others)), *first.sizes, *first.spacing, *first.place, *first.directions.flat
    return tuple(round(float(each), 3) for each in numbers)


def chosen(every: Sequence[FileSeries], series: str | None) -> FileSeries:
    """Return the only series, or the one whose number or UID is asked for."""
    matching = [each for each in every if series in (None, ALL, each.uid, each.number)]
    if len(matching) != 1:
        what = "several series" if series is None else f"{len(matching)} series for {series!r}"
        raise ArgumentError(
            f"expected one series of DICOM slices, got {what}; choose one by dataset.volume.series=NUMBER "
            f"or UID, or series={ALL} for those alike, as steps in time, of {'; '.join(map(str, every))}"
        )
    return matching[0]


def slices_of(series: FileSeries) -> list[Slice]:
    """Return the slices of a series, sorted by height."""
    slices = [each for file in series.files for each in slices_in(Path(file))]
    return sorted(slices, key=lambda each: each.height)


def is_damaged(path: Path) -> bool:
    """Return whether a file that GDCM does not list should be a slice; hidden ones of macOS do not count."""
    if path.name.startswith(".") or not path.is_file():
        return False
    with path.open("rb") as file:
        is_dicom = file.read(132)[128:] == MAGIC
        return PIXELS in file.read() if is_dicom else path.suffix.lower() == ".dcm"


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
    """Return index and name of the tag that tells all slices at one place apart."""
    for index, name in enumerate(TIMES):
        values = [[each.times[index] for each in place] for place in places]
        if all("" not in some and len({*map(float, some)}) == len(some) for some in values):
            return index, name
    first, second = next(place for place in places if len(place) > 1)[:2]
    raise ArgumentError(
        f"{first.name} and {second.name}: expected slices at different places, got two at one, and "
        f"no {' or '.join(TIMES)} in all that tells such slices apart; {CONVERT}"
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
                f"{each.name}: expected size, spacing and orientation of {first.name}; {CONVERT}"
            )
        shift = np.abs(first.directions[:2] @ (each.place - first.place)).max()
        if shift > TILT * (each.height - first.height) + ROUNDING:
            raise ArgumentError(
                f"{each.name}: expected slices behind each other, got one {shift:.3g} mm "
                f"beside {first.name}; correct the tilt of the gantry first"
            )
    gaps = np.diff([each.height for each in slices])
    step = float(np.sort(gaps)[(len(gaps) - 1) // 2])
    worst = int(np.abs(gaps - step).argmax())
    if abs(gaps[worst] - step) > UNEVEN * step:
        raise ArgumentError(
            f"{slices[worst].name} and {slices[worst + 1].name}: expected slices {step:.6g} mm apart, got "
            f"{gaps[worst]:.6g} mm; complete the series, or {CONVERT}"
        )
    return float(slices[-1].height - first.height) / len(gaps)
