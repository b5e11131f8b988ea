"""Image data that VTK reads, as lattice and samples."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pyvista
from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow
from vtkmodules.vtkCommonExecutionModel import vtkStreamingDemandDrivenPipeline as Pipeline

from texgs.core.errors import ArgumentError
from texgs.volume.grid import dims_of, require_room


def read_vtk(path: Path, variable: str | None = None) -> tuple[dict[str, Any], np.ndarray]:
    """Read lattice and samples [Z, Y, X] of a point array: the one named, the scalars, or the first."""
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    reader = pyvista.get_reader(str(path))
    reader.reader.UpdateInformation()
    check_claim(reader.reader)
    image = reader.read()
    if message := first_message(window):
        raise ArgumentError(f"expected a {path.suffix} file, VTK says: {message}; is it damaged or cut off?")
    if not isinstance(image, pyvista.ImageData):
        kind = type(image).__name__
        raise ArgumentError(f"expected image data (structured points), got {kind}; resample it to an image")
    if not image.point_data:
        raise ArgumentError("expected point data, found none; convert cell data to point data")
    name, note = chosen(image.point_data, variable)
    values = image.point_data[name]
    shape = image.dimensions[::-1]
    if values.size != np.prod(shape, dtype=np.int64):
        raise ArgumentError(f"expected image data of {list(shape)}, got {values.size} values; is it damaged?")
    first = [0.0, 0.0, 0.0]
    image.TransformIndexToPhysicalPoint(list(image.extent[::2]), first)
    lattice = {
        "dims": dims_of(shape),
        "dtype": values.dtype.name,
        "spacing": image.spacing,
        "origin": first,
        "directions": image.direction_matrix.T.tolist(),
        "note": note,
    }
    return lattice, np.asarray(values).reshape(shape)


def chosen(arrays: Any, variable: str | None) -> tuple[str, str]:
    """Return the name of the scalar array of points to take, and what to tell the user of others."""
    names = [name for name, values in arrays.items() if values.ndim == 1]
    if not names:
        sizes = ", ".join(f"{values.shape[1]} components per sample" for values in arrays.values())
        raise ArgumentError(f"expected a scalar volume, got {sizes}")
    if variable is not None and variable not in names:
        raise ArgumentError(f"dataset.volume.variable: expected one of {', '.join(names)}, got {variable}")
    active = arrays.active_scalars_name
    name = variable or (active if active in names else names[0])
    is_open = len(names) > 1 and variable is None
    others = ", ".join(each for each in names if each != name)
    return name, f"array {name}; dataset.volume.variable chooses another ({others})" if is_open else ""


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
