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
from texgs.volume.grid import dims_of, require_room

XML_SUFFIXES = (".vti", ".vtr", ".vts", ".pvti", ".pvtr")  # suffixes
TAIL = 1024  # bytes; more than the end tag and whatever blanks an editor left behind it
SPACING_TOLERANCE = 0.01  # of a distance: coordinates are often rounded to float32


def read_vtk(path: Path, variable: str | None = None) -> tuple[dict[str, Any], np.ndarray]:
    """Read lattice and samples [Z, Y, X], see `field_of`."""
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    if path.suffix.lower() in XML_SUFFIXES:
        require_whole(path)
    reader = pyvista.get_reader(str(path))
    reader.reader.UpdateInformation()
    check_claim(reader.reader)
    image = reader.read()
    if message := first_message(window):
        raise ArgumentError(f"expected a {path.suffix} file, VTK says: {message}; is it damaged or cut off?")
    return field_of(image, variable)


def field_of(image: Any, variable: str | None = None) -> tuple[dict[str, Any], np.ndarray]:
    """Return lattice and samples [Z, Y, X] of an array: the one named, the scalars, or the first.

    Samples of cells lie in their middles.
    """
    directions = np.eye(3)
    if isinstance(image, pyvista.ImageData):
        spacing, directions = np.array(image.spacing), np.reshape(image.direction_matrix, (3, 3)).T
    elif isinstance(image, pyvista.RectilinearGrid):
        places = [np.asarray(each, np.float64) for each in (image.x, image.y, image.z)]
        gaps = [np.diff(each) if each.size > 1 else np.ones(1) for each in places]
        if uneven := [
            x for x, each in zip("xyz", gaps, strict=True) if np.ptp(each) > SPACING_TOLERANCE * each[0]
        ]:
            raise ArgumentError(f"expected even distances along {', '.join(uneven)}; resample it to an image")
        spacing = np.array([each.mean() for each in gaps])
    else:
        kind = type(image).__name__
        raise ArgumentError(f"expected image data (structured points), got {kind}; resample it to an image")
    values, is_cell, note = choose_array(image, variable)
    shape = tuple(size - is_cell for size in image.dimensions[::-1])
    if values.size != np.prod(shape, dtype=np.int64):
        raise ArgumentError(f"expected image data of {list(shape)}, got {values.size} values; is it damaged?")
    lattice = {
        "dims": dims_of(shape),
        "dtype": values.dtype.name,
        "spacing": spacing.tolist(),
        "origin": (image.GetPoint(0) + 0.5 * is_cell * spacing @ directions).tolist(),
        "directions": directions.tolist(),
        "note": note,
    }
    return lattice, values.reshape(shape)


def choose_array(image: Any, variable: str | None) -> tuple[np.ndarray, bool, str]:
    """Return the array to read, whether it has cell data, and a note about other arrays.

    Those of points come first, also where cells have one of that name.
    """
    every = [{**image.point_data}, {**image.cell_data}]
    points, cells = ({name: values for name, values in data.items() if values.ndim == 1} for data in every)
    names = [*(points | cells)]
    if not names:
        sizes = [f"{values.shape[1]} components per sample" for data in every for values in data.values()]
        raise ArgumentError(f"expected scalars of points or cells, got {', '.join(sizes) or 'none'}")
    if variable is not None and variable not in names:
        raise ArgumentError(f"dataset.volume.variable: expected one of {', '.join(names)}, got {variable}")
    wanted = variable or image.active_scalars_name
    name = wanted if wanted in names else names[0]
    others = ", ".join(each for each in names if each != name)
    note = f"array {name}; dataset.volume.variable chooses another ({others})"
    values, is_cell = np.asarray((cells | points)[name]), name not in points
    return values, is_cell, note if others and variable is None else ""


def require_whole(path: Path) -> None:
    """Require a file of XML with its end, and all its pieces.

    VTK reads uncompressed samples past the end without a word, and fills up with zeros.
    """
    suffix = path.suffix.lower()
    if not path.is_file():
        raise ArgumentError(f"expected a piece {path.name} beside it, found none; copy it there")
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - TAIL))
        if b"</VTKFile>" not in file.read():
            raise ArgumentError(f"the file is cut off or no {suffix} file: expected </VTKFile> at its end")
    if suffix.startswith(".p"):
        for piece in ElementTree.parse(path).iter("Piece"):
            require_whole(path.parent / piece.get("Source", ""))


def check_claim(reader: Any) -> None:
    """Require that the claims of a header fit into memory; only XML headers are read before samples."""
    information = reader.GetOutputInformation(0)
    if information is not None and information.Has(Pipeline.WHOLE_EXTENT()):
        extent = np.array(information.Get(Pipeline.WHOLE_EXTENT()), np.int64)
        x, y, z = (extent[1::2] - extent[::2] + 1).tolist()
        if min(x, y, z) > 0:
            require_room((x, y, z), np.dtype(np.uint8))  # a byte each at least


def first_message(window: Any) -> str:
    """Return the first error or warning that VTK printed instead of raising it, or "".

    Without the place in VTK's source, and the address of the object.
    """
    output = window.GetOutput()  # bytes if a damaged file is quoted
    text = output.decode(errors="replace") if isinstance(output, bytes) else output
    message = next(filter(str.strip, text.split("\n\n")), "")
    bare = " ".join(re.sub(r"(?m)^(ERROR|(Generic )?Warning): In.*", "", message).split())
    return bare.split("): ", 1)[-1].strip(" .!")
