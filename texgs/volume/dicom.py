"""Folders of DICOM slices, as lattice and samples.

Which series, which of its steps in time, and whether their slices are a lattice.
"""

from collections.abc import Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import SimpleITK as sitk

from texgs.core.errors import ArgumentError
from texgs.volume.dicom_phases import ALL, FileSeries, phases_of
from texgs.volume.grid import require_room
from texgs.volume.itk_image import require_volume, sentence
from texgs.volume.slabs import require_step

OF_SERIES = "0020|0011", "0008|103e", "0020|0100"  # tags: number, description and position in time
PLACE, ORIENTATION = "0020|0032", "0020|0037"  # and of a slice
# Tags that order slices at one place in time: the first does whose values differ at each place.
TIMES = {"0020|0100": "temporal position", "0018|1060": "trigger time", "0020|0012": "acquisition number"}
UNEVEN = 0.05  # of the distance of slices: how much one may differ, as places are rounded in files
TILT = 0.01  # of the distance of the outer slices: how far one may be shifted across it
ROUNDING = 0.01  # mm; and of the widest gap: slices that are closer are at one place
MAGIC, PIXELS = b"DICM", b"\xe0\x7f\x10\x00"  # of a file with 128 bytes before it; the tag of its samples


class Slice(NamedTuple):
    """One file of a series."""

    path: Path
    sizes: tuple[int, ...]
    spacing: tuple[float, ...]
    place: np.ndarray  # [3] of the first sample, mm: to the left, the back and the head
    directions: np.ndarray  # [3, 3] in rows: along a row of samples, along a column, and from slice to slice
    pixel_id: int
    n_components: int
    times: tuple[str, ...]  # what it says for `TIMES`

    @property
    def height(self) -> float:
        """Where the slice is along the normal of its plane."""
        return float(self.place @ self.directions[2])


def read_dicom(folder: Path, series: str | None, time: int) -> tuple[dict[str, Any], np.ndarray]:
    """Read lattice and samples [Z, Y, X], rescaled by slope and intercept, of a step of a series."""
    sitk.ProcessObject.GlobalWarningDisplayOff()
    try:
        slices, n_steps, note = step_at(folder, series, time)
        step, first = slice_distance(slices), slices[0]
        pixel_ids = {each.pixel_id for each in slices}
        pixel_id = sitk.sitkFloat64 if len(pixel_ids) > 1 else pixel_ids.pop()
        dims, dtype = require_volume([*first.sizes[:2], len(slices)], pixel_id, first.n_components)
        require_room(dims, dtype)
        reader = sitk.ImageSeriesReader()
        reader.SetFileNames([str(each.path) for each in slices])
        reader.SetOutputPixelType(pixel_id)
        values = sitk.GetArrayFromImage(reader.Execute())
    except RuntimeError as error:
        raise ArgumentError(sentence(error)) from error
    lattice = {
        "dims": dims,
        "dtype": values.dtype.name,
        "spacing": (*first.spacing[:2], step),
        "origin": first.place.tolist(),
        "directions": first.directions.tolist(),
        "n_steps": n_steps,
        "note": note,
    }
    return lattice, values


def step_at(folder: Path, series: str | None, time: int) -> tuple[list[Slice], int, str]:
    """Return the slices of a step, how many steps there are, and what there is to say about them."""
    every = series_in(folder)
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
        first, lattice = header(Path(files[0])), lattice_of(Path(files[0]), len(files))
        number, description, position = (tag(first, each) for each in OF_SERIES)
        every.append(FileSeries(number, description, position, uid, files, lattice))
    names = {Path(file).name for each in every for file in each.files}
    unlisted = [path for path in sorted(folder.iterdir()) if path.name not in names]
    if foreign := next((path.name for path in unlisted if is_foreign(path)), None):
        raise ArgumentError(f"{foreign}: expected a file of DICOM, got another; correct it, or take it away")
    if damaged := next((path.name for path in unlisted if is_slice(path)), None):
        raise ArgumentError(f"{damaged}: cut off or damaged; put the whole slice there, or take it away")
    if not every:
        raise ArgumentError("expected a folder of DICOM slices or TIFFs (.tif, .tiff), found none in it")
    return every


def lattice_of(file: Path, count: int) -> tuple[float, ...]:
    """Return that of a series as `FileSeries` has it, rounded to 0.001 mm."""
    try:
        first = slice_of(file)
    except ArgumentError:  # a report, say, that has no place
        return ()
    numbers = count, *first.sizes[:2], *first.spacing[:2], *first.place, *first.directions.flat
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
    return sorted((slice_of(Path(file)) for file in series.files), key=lambda each: each.height)


def is_slice(path: Path) -> bool:
    """Return whether a file is one of DICOM with samples; GDCM lists none that is damaged."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(132)[128:] == MAGIC and PIXELS in file.read()


def is_foreign(path: Path) -> bool:
    """Return whether a file is none of DICOM, but has its ending; hidden ones of macOS do not count."""
    if path.suffix.lower() != ".dcm" or path.name.startswith(".") or not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(132)[128:] != MAGIC


def slice_of(path: Path) -> Slice:
    """Read the header of a slice."""
    reader = header(path)
    place, axes = (
        [float(number) for number in tag(reader, name).split("\\") if number] for name in (PLACE, ORIENTATION)
    )
    if (len(place), len(axes)) != (3, 6):
        raise ArgumentError(f"{path.name}: expected a slice with its position and orientation, found none")
    if len(reader.GetSize()) > 2 and reader.GetSize()[2] != 1:
        raise ArgumentError(f"{path.name}: expected one slice per file, got {reader.GetSize()[2]} frames")
    row, column = np.reshape(axes, (2, 3))
    directions = np.stack([row, column, np.cross(row, column)])
    if not np.allclose(directions @ directions.T, np.eye(3), atol=1e-3):
        raise ArgumentError(f"{path.name}: expected rows and columns at right angles, got {axes}")
    kind, times = (reader.GetPixelIDValue(), reader.GetNumberOfComponents()), (tag(reader, t) for t in TIMES)
    return Slice(
        path, reader.GetSize(), reader.GetSpacing(), np.array(place), directions, *kind, tuple(times)
    )


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
    for place in places:
        if len(place) != len(first):
            raise ArgumentError(
                f"expected a slice of each {name} at each place, got {len(first)} at "
                f"{first[0].height:.6g} mm, {len(place)} at {place[0].height:.6g} mm; complete the series"
            )
    in_order = [sorted(place, key=lambda each: float(each.times[index])) for place in places]
    return [list(step) for step in zip(*in_order, strict=True)]


def time_tag(places: list[list[Slice]]) -> tuple[int, str]:
    """Return index and name of the tag that tells all slices at one place apart."""
    lacking = ""
    for index, name in enumerate(TIMES.values()):
        values = [[each.times[index] for each in place] for place in places]
        if all("" not in some and len({*map(float, some)}) == len(some) for some in values):
            return index, name
        without = [each.path.name for place in places for each in place if not each.times[index]]
        if 0 < len(without) < sum(map(len, places)):
            lacking += f"; {without[0]} has no {name}"
    first, second = next(place for place in places if len(place) > 1)[:2]
    raise ArgumentError(
        f"{first.path.name} and {second.path.name}: expected slices at different places, got two at one, and "
        f"no {' or '.join(TIMES.values())} that tells such slices apart{lacking}"
    )


def slice_distance(slices: list[Slice]) -> float:
    """Return the distance from slice to slice, in mm, of a series in the order of its places."""
    first = slices[0]
    if len(slices) < 2:
        raise ArgumentError("expected at least 2 slices, got 1")
    for each in slices:
        is_like = each.sizes[:2] == first.sizes[:2] and np.allclose(each.spacing[:2], first.spacing[:2])
        if not is_like or not np.allclose(each.directions, first.directions, atol=1e-3):
            raise ArgumentError(
                f"{each.path.name}: expected size, spacing and orientation of {first.path.name}"
            )
        shift = np.abs(first.directions[:2] @ (each.place - first.place)).max()
        if shift > TILT * (each.height - first.height) + ROUNDING:
            raise ArgumentError(
                f"{each.path.name}: expected slices behind each other, got one {shift:.3g} mm "
                f"beside {first.path.name}; correct the tilt of the gantry first"
            )
    gaps = np.diff([each.height for each in slices])
    step = float(np.sort(gaps)[(len(gaps) - 1) // 2])
    for before, after, gap in zip(slices, slices[1:], gaps, strict=False):
        if abs(gap - step) > UNEVEN * step:
            count = round(gap / step)
            is_missing = count > 1 and abs(gap - count * step) <= UNEVEN * step
            found = f"{count - 1} missing" if is_missing else "another"
            raise ArgumentError(
                f"{before.path.name} and {after.path.name}: expected slices {step:.6g} mm apart, got "
                f"{gap:.6g} mm: {found}; complete the series, or resample it"
            )
    return float(slices[-1].height - first.height) / (len(slices) - 1)


def header(path: Path) -> sitk.ImageFileReader:
    """Return a reader that has read a header."""
    reader = sitk.ImageFileReader()
    reader.SetFileName(str(path))
    reader.ReadImageInformation()
    return reader


def tag(reader: sitk.ImageFileReader, name: str) -> str:
    """Return the text of a tag; empty where there is none."""
    return str(reader.GetMetaData(name)).strip() if reader.HasMetaDataKey(name) else ""
