"""Series of a DICOM folder: which there are, which is asked for, and which are steps in time, as of 4D CT."""

import re
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import pydicom
import SimpleITK as sitk

from texgs.core.errors import ArgumentError
from texgs.volume.dicom_slice import slices_in, values_in

ALL = "all"  # instead of the number of a series
SERIES_TAGS = ["SeriesNumber", "SeriesDescription", "TemporalPositionIdentifier", "Modality"]
MAGIC, PIXELS = b"DICM", b"\xe0\x7f\x10\x00"  # of a file with 128 bytes before it; the tag of its samples
# What orders series, and how it stands in them: the first counts that is not the same in all.
ORDERS = {
    "temporal position": ("position", r"^(-?\d+)$"),
    "percentage": ("description", r"(\d+(?:\.\d+)?) ?%"),
    "series number": ("number", r"^(-?\d+)$"),
}


class FileSeries(NamedTuple):
    """A series in a folder, described by its first file."""

    files: Sequence[str]
    uid: str = ""
    number: str = ""
    description: str = ""
    position: str = ""  # in time
    lattice: tuple[float, ...] = ()  # number of slices, and all that the first says of it; empty: it has none

    def __str__(self) -> str:
        return f"{self.number} ({self.description}, {len(self.files)} files, UID {self.uid})"


def series_in(folder: Path) -> list[FileSeries]:
    """Return all series of a folder, one at least; no slice may be damaged."""
    every, reader = [], sitk.ImageSeriesReader
    for uid in reader.GetGDCMSeriesIDs(str(folder)):
        files = reader.GetGDCMSeriesFileNames(str(folder), uid)
        header = pydicom.dcmread(files[0], stop_before_pixels=True, force=True, specific_tags=SERIES_TAGS)
        first = values_in([header])
        number, description, position, kind = (str(first.get(each, "")) for each in SERIES_TAGS)
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
    """Return the lattice of a series for `FileSeries`, rounded to 0.001 mm."""
    try:
        first, *others = slices_in(file)
    except (ArgumentError, KeyError):  # no image, such as a report
        return ()
    numbers = count * (1 + len(others)), *first.sizes, *first.spacing, *first.place, *first.directions.flat
    return tuple(round(float(each), 3) for each in numbers)


def choose_series(every: Sequence[FileSeries], series: str | None) -> FileSeries:
    """Return the only series, or the one whose number or UID is asked for."""
    matching = [each for each in every if series in (None, ALL, each.uid, each.number)]
    if len(matching) != 1:
        what = "several series" if series is None else f"{len(matching)} series for {series!r}"
        raise ArgumentError(
            f"expected one series of DICOM slices, got {what}; choose one by dataset.volume.series=NUMBER "
            f"or UID, or series={ALL} for those alike, as steps in time, of {'; '.join(map(str, every))}"
        )
    return matching[0]


def is_damaged(path: Path) -> bool:
    """Return whether a file that GDCM does not list should be a slice; hidden ones of macOS do not count."""
    if path.name.startswith(".") or not path.is_file():
        return False
    with path.open("rb") as file:
        is_dicom = file.read(132)[128:] == MAGIC
        return PIXELS in file.read() if is_dicom else path.suffix.lower() == ".dcm"


def phases_of(every: Sequence[FileSeries]) -> tuple[list[FileSeries], str]:
    """Return the series on the lattice that most have, in the order of time, and a sentence on them."""
    ranked = Counter(each.lattice for each in every if each.lattice).most_common(2)
    (lattice, count), (_, next_count), *_ = [*ranked, ((), 0), ((), 0)]
    if count < 2 or count == next_count:
        got = "; ".join(map(str, every))
        raise ArgumentError(f"expected series on one lattice, more than on any other, got {got}")
    phases, left = ([each for each in every if (each.lattice == lattice) is x] for x in (True, False))
    if part := next((each for each in left if each.lattice[1:] == lattice[1:]), None):
        raise ArgumentError(f"expected series as long as {phases[0]}, got {part}; complete them")
    phases, name = in_order(phases)
    words = f"steps are the {count} series {phases[0].number} to {phases[-1].number}, ordered by {name}"
    return phases, words + (f"; left out, on other lattices: {'; '.join(map(str, left))}" if left else "")


def in_order(phases: Sequence[FileSeries]) -> tuple[list[FileSeries], str]:
    """Return series in the order of time, and the tag of the order."""
    for name, (field, pattern) in ORDERS.items():
        matches = [re.search(pattern, getattr(each, field)) for each in phases]
        numbers = {each: float(match[1]) for each, match in zip(phases, matches, strict=True) if match}
        if len({*numbers.values()}) == len(phases):
            return sorted(phases, key=numbers.__getitem__), name
        if len({*map(numbers.get, phases)}) > 1:
            break
    raise ArgumentError(f"expected a {name} in each series, all different, got {'; '.join(map(str, phases))}")
