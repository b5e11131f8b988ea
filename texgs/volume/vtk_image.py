"""Image data that VTK reads, as lattice and samples."""

import re
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pyvista
from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline

from texgs.core.errors import ArgumentError
from texgs.volume.grid import Triple, dims_of, require_room

IN_XML = (".vti", ".vtr", ".vts", ".pvti", ".pvtr")  # suffixes
TAIL = 1024  # bytes; more than the end tag and whatever blanks an editor left behind it
UNEVEN = 0.01  # of a distance: coordinates are often rounded to float32


def read_vtk(path: Path, variable: str | None = None) -> tuple[dict[str, Any], np.ndarray]:
    """Read lattice and samples [Z, Y, X] of an array: the one named, the scalars, or the first."""
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    if path.suffix.lower() in IN_XML:
        require_pieces(path)
    reader = pyvista.get_reader(str(path))
    reader.reader.UpdateInformation()
    check_claim(reader.reader)
    image = reader.read()
    if message := first_message(window):
        raise ArgumentError(f"expected a {path.suffix} file, VTK says: {message}; is it damaged or cut off?")
    values, spacing, first, directions, note = field_of(image, variable)
    lattice = {
        "dims": dims_of(values.shape),
        "dtype": values.dtype.name,
        "spacing": spacing,
        "origin": first,
        "directions": directions.tolist(),
        "note": note,
    }
    return lattice, values


def field_of(image: Any, variable: str | None) -> tuple[np.ndarray, Triple, list[float], np.ndarray, str]:
    """Return samples [Z, Y, X], spacing, the first place, directions in rows, and what was chosen.

    Samples of cells lie in their middles.
    """
    first, directions = [0.0, 0.0, 0.0], np.eye(3)
    if isinstance(image, pyvista.ImageData):
        spacing, directions = image.spacing, np.reshape(image.direction_matrix, (3, 3)).T
        image.TransformIndexToPhysicalPoint(list(image.extent[::2]), first)
    elif isinstance(image, pyvista.RectilinearGrid):
        places = [np.asarray(each, np.float64) for each in (image.x, image.y, image.z)]
        gaps = [np.diff(each) if each.size > 1 else np.ones(1) for each in places]
        uneven = [name for name, each in zip("xyz", gaps, strict=True) if np.ptp(each) > UNEVEN * each[0]]
        if uneven:
            raise ArgumentError(f"expected even distances along {', '.join(uneven)}; resample it to an image")
        dx, dy, dz = (float(each.mean()) for each in gaps)
        first, spacing = [float(each[0]) for each in places], (dx, dy, dz)
    else:
        kind = type(image).__name__
        raise ArgumentError(f"expected image data (structured points), got {kind}; resample it to an image")
    name, is_cell, note = chosen(image, variable)
    values = np.asarray((image.point_data, image.cell_data)[is_cell][name])
    shape = tuple(size - is_cell for size in image.dimensions[::-1])
    if values.size != np.prod(shape, dtype=np.int64):
        raise ArgumentError(f"expected image data of {list(shape)}, got {values.size} values; is it damaged?")
    origin = first + 0.5 * is_cell * np.array(spacing) @ directions
    return values.reshape(shape), spacing, origin.tolist(), directions, note


def chosen(image: Any, variable: str | None) -> tuple[str, bool, str]:
    """Return the name of the scalar array to take, whether it is one of cells, and what to tell of others.

    Those of points come first, also where cells have one of that name.
    """
    of = (image.point_data, image.cell_data)
    arrays = [(name, is_cell, of[is_cell][name]) for is_cell in (False, True) for name in of[is_cell]]
    if not arrays:
        raise ArgumentError("expected data of points or cells, found none")
    scalars = [(name, is_cell) for name, is_cell, values in arrays if values.ndim == 1]
    if not scalars:
        sizes = ", ".join(f"{values.shape[1]} components per sample" for *_, values in arrays)
        raise ArgumentError(f"expected a scalar volume, got {sizes}")
    names = [name for name, _ in scalars]
    if variable is not None and variable not in names:
        raise ArgumentError(f"dataset.volume.variable: expected one of {', '.join(names)}, got {variable}")
    wanted = variable or image.active_scalars_name
    taken = scalars[names.index(wanted) if wanted in names else 0]
    others = ", ".join(name + " of cells" * is_cell for name, is_cell in scalars if name != taken[0])
    note = f"array {taken[0]}; dataset.volume.variable chooses another ({others})"
    return *taken, note if others and variable is None else ""


def require_pieces(path: Path) -> None:
    """Require all pieces of a file in parts, each with its end: VTK fills up with zeros."""
    check_end(path)
    if path.suffix.lower().startswith(".p"):
        for piece in ElementTree.parse(path).iter("Piece"):
            source = path.parent / piece.get("Source", "")
            if not source.is_file():
                raise ArgumentError(f"expected a piece {source.name} beside it, found none; copy it there")
            check_end(source)


def check_end(path: Path) -> None:
    """Refuse an XML file that is cut off: VTK reads uncompressed samples past its end without a word."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - TAIL))
        if b"</VTKFile>" not in file.read():
            kind = path.suffix.lower()
            raise ArgumentError(f"the file is cut off or no {kind} file: expected </VTKFile> at its end")


def check_claim(reader: Any) -> None:
    """Require that what a header claims fits into memory; only headers of XML are read before samples."""
    information = reader.GetOutputInformation(0)
    if information is not None and information.Has(Pipeline.WHOLE_EXTENT()):
        extent = np.array(information.Get(Pipeline.WHOLE_EXTENT()), np.int64)
        x, y, z = (extent[1::2] - extent[::2] + 1).tolist()
        if min(x, y, z) > 0:
            require_room((x, y, z), np.dtype(np.uint8))  # a byte each at least


def first_message(window: Any) -> str:
    """Return the first error or warning that VTK has printed instead of raising it; empty for none.

    Without the place in VTK's source, and the address of the object.
    """
    output = window.GetOutput()  # bytes where a damaged file is quoted that is no text
    text = output.decode(errors="replace") if isinstance(output, bytes) else output
    message = next((message for message in text.split("\n\n") if message.strip()), "").strip()
    lines = [line for line in message.splitlines() if not re.match(r"(ERROR|(Generic )?Warning): In", line)]
    return " ".join(lines).split("): ", 1)[-1].strip(" .!")
