"""Images and folders of DICOM slices that SimpleITK reads, as lattice and samples.

Of DICOM: which series, and whether its slices are a lattice.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import SimpleITK as sitk

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Dims, check_lattice, require_room
from texgs.volume.headers import NRRD, read_fields

# ITK's space runs to the left and the back, that of these NRRD files to the right and the front.
TO_RIGHT_FRONT = (-1.0, -1.0, 1.0)
NRRD_SPACES = {
    "right-anterior-superior": TO_RIGHT_FRONT,
    "ras": TO_RIGHT_FRONT,
    "left-anterior-superior": TO_RIGHT_FRONT,
    "las": TO_RIGHT_FRONT,
    "3d-left-handed": (-1.0, 1.0, 1.0),
}
SOURCE_LINE = re.compile(r"^.*?(?:sitk::ERROR|ITK ERROR|itk::ERROR): (?:\w+\(0x[0-9a-f]+\): )?", re.DOTALL)
NUMBER, DESCRIPTION, PLACE, ORIENTATION = "0020|0011", "0008|103e", "0020|0032", "0020|0037"  # tags
UNEVEN = 0.05  # of the distance of slices: how much one may differ, as places are rounded in files
TILT = 0.01  # of the distance of the outer slices: how far one may be shifted across it
ROUNDING = 0.01  # mm
MAGIC, PIXELS = b"DICM", b"\xe0\x7f\x10\x00"  # of a file with 128 bytes before it; the tag of its samples


def read_itk(path: Path, is_header_only: bool) -> tuple[dict[str, Any], np.ndarray | None]:
    """Read the lattice in the file's own space, and samples [Z, Y, X] unless only the header is asked for."""
    sitk.ProcessObject.GlobalWarningDisplayOff()
    reader = sitk.ImageFileReader()
    reader.SetFileName(str(path))
    try:
        reader.ReadImageInformation()
        sizes = list(reader.GetSize())
        dims, dtype = require_volume(sizes, reader.GetPixelIDValue(), reader.GetNumberOfComponents())
        fields = read_fields(path)[0] if path.suffix.lower() in NRRD else {}
        signs = np.array(NRRD_SPACES.get(fields.get("space", "").lower(), (1.0, 1.0, 1.0)))
        lattice: dict[str, Any] = {
            "dims": dims,
            "dtype": dtype.name,
            "spacing": reader.GetSpacing(),
            "origin": (np.array(reader.GetOrigin()) * signs + 0.0).tolist(),
            "directions": (np.reshape(reader.GetDirection(), (3, 3)).T * signs).tolist(),
        }
        if {"axismins", "axismaxs"} <= fields.keys() and "spacedirections" not in fields:
            lattice["origin"] = np.nan_to_num(np.array(fields["axismins"].split(), float)).tolist()
            if "spacings" not in fields:
                lattice["spacing"] = _steps(fields, dims)
        if is_header_only:
            return lattice, None
        require_room(dims, dtype)
        return lattice, sitk.GetArrayFromImage(reader.Execute())
    except RuntimeError as error:
        raise ArgumentError(sentence(error)) from error


def require_volume(
    sizes: list[int], pixel_id: int, n_components: int
) -> tuple[tuple[int, int, int], np.dtype]:
    """Require three axes of scalar samples, and return dims and sample type."""
    if n_components != 1:
        raise ArgumentError(f"expected a scalar volume, got {n_components} components per sample")
    if len(sizes) != 3:
        raise ArgumentError(f"expected 3 axes, got {len(sizes)}: sizes {sizes}")
    dtype = sitk.GetArrayViewFromImage(sitk.Image([1, 1, 1], pixel_id)).dtype
    dims = (sizes[0], sizes[1], sizes[2])
    check_lattice(dims, dtype)
    return dims, dtype


def _steps(fields: dict[str, str], dims: Dims) -> list[float]:
    """Return distances of samples by the ends of axes: places of the outer ones, or edges of cells."""
    low, high = (np.array(fields[name].split(), float) for name in ("axismins", "axismaxs"))
    words = fields.get("centerings", fields.get("centers", "node node node")).split()
    gaps = [size - (word != "cell") for size, word in zip(dims, words, strict=True)]
    steps = np.abs(high - low) / np.maximum(gaps, 1)
    return np.where(np.isfinite(steps), steps, 1.0).tolist()


def sentence(error: RuntimeError) -> str:
    """Return what ITK says without the place in its source."""
    return SOURCE_LINE.sub("", str(error).strip()).strip(" .!")


class Slice(NamedTuple):
    """One file of a series."""

    path: Path
    sizes: tuple[int, ...]
    spacing: tuple[float, ...]
    place: np.ndarray  # [3] of the first sample, mm: to the left, the back and the head
    directions: np.ndarray  # [3, 3] in rows: along a row of samples, along a column, and from slice to slice
    pixel_id: int
    n_components: int

    @property
    def height(self) -> float:
        """Where the slice is along the normal of its plane."""
        return float(self.place @ self.directions[2])


def read_dicom(folder: Path, series: str | None) -> tuple[dict[str, Any], np.ndarray]:
    """Read lattice and samples [Z, Y, X], rescaled by slope and intercept, of a series in a folder."""
    sitk.ProcessObject.GlobalWarningDisplayOff()
    try:
        files = chosen_files(folder, series)
        slices = sorted((slice_of(Path(file)) for file in files), key=lambda each: each.height)
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
    }
    return lattice, values


def chosen_files(folder: Path, series: str | None) -> list[str]:
    """Return the files of the only series, or of the one whose number or UID is asked for."""
    chosen, titles, listed = [], [], set[str]()
    for uid in sitk.ImageSeriesReader.GetGDCMSeriesIDs(str(folder)):
        files = list(sitk.ImageSeriesReader.GetGDCMSeriesFileNames(str(folder), uid))
        reader = header(Path(files[0]))
        number = tag(reader, NUMBER)
        titles.append(f"{number} ({tag(reader, DESCRIPTION)}, {len(files)} files, UID {uid})")
        if series is None or series in (uid, number):
            chosen.append(files)
        listed.update(Path(file).name for file in files)
    unlisted = (path for path in sorted(folder.iterdir()) if path.name not in listed)
    if damaged := next((path.name for path in unlisted if is_slice(path)), None):
        raise ArgumentError(f"{damaged}: cut off or damaged; put the whole slice there, or take it away")
    if not titles:
        raise ArgumentError("expected a folder of DICOM slices or TIFFs (.tif, .tiff), found none in it")
    if len(chosen) != 1:
        what = "several series" if series is None else f"{len(chosen)} series for {series!r}"
        raise ArgumentError(
            f"expected one series of DICOM slices, got {what}; choose one by dataset.volume.series=NUMBER "
            f"or UID, of {'; '.join(titles)}"
        )
    return chosen[0]


def is_slice(path: Path) -> bool:
    """Return whether a file is one of DICOM with samples; GDCM lists none that is damaged."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(132)[128:] == MAGIC and PIXELS in file.read()


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
    kind = reader.GetPixelIDValue(), reader.GetNumberOfComponents()
    return Slice(path, reader.GetSize(), reader.GetSpacing(), np.array(place), directions, *kind)


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
        between = f"{before.path.name} and {after.path.name}"
        if gap < ROUNDING * step or gap <= 0:
            raise ArgumentError(f"{between}: expected slices at different places, got two at one")
        if abs(gap - step) > UNEVEN * step:
            count = round(gap / step)
            is_missing = count > 1 and abs(gap - count * step) <= UNEVEN * step
            found = f"{count - 1} missing" if is_missing else "another"
            raise ArgumentError(
                f"{between}: expected slices {step:.6g} mm apart, got {gap:.6g} mm: {found}; "
                "complete the series, or resample it"
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
